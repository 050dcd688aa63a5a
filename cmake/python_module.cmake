# The Python module ctcr._core and its typed stub; pip installs both beside the Python sources in tools/ctcr.
file(GLOB sources CONFIGURE_DEPENDS tools/ctcr/_core/*.cpp)
if(NOT sources)
  return()
endif()

find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module)
execute_process(COMMAND ${Python_EXECUTABLE} -m nanobind --cmake_dir OUTPUT_VARIABLE nanobind_ROOT
                OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
find_package(nanobind CONFIG REQUIRED)

# What takes long to compile, a file for each number of tubes. The other sources know these numbers too.
set(CTCR_TUBES 1 2 3 4 CACHE STRING "Numbers of tubes of the robots that the Python module models, of 1 to 4")
foreach(tubes IN LISTS CTCR_TUBES)
  foreach(part solvers models)
    set(instance ${CMAKE_CURRENT_BINARY_DIR}/_core/${part}_of_${tubes}.cpp)
    configure_file(tools/ctcr/_core/${part}_of_n.cpp.in ${instance} @ONLY)
    list(APPEND instances ${instance})
  endforeach()
endforeach()
list(JOIN CTCR_TUBES "," tubes)
set_source_files_properties(${sources} PROPERTIES COMPILE_DEFINITIONS CTCR_TUBES=${tubes})

# add_core(TARGET FOLDER [OPTION...]): the module, compiled with these options, installed into FOLDER.
function(add_core target folder)
  nanobind_add_module(${target} NB_STATIC NOMINSIZE NB_DOMAIN ctcr ${sources} ${instances})
  set_target_properties(${target} PROPERTIES OUTPUT_NAME _core LIBRARY_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/${target})
  target_include_directories(${target} PRIVATE tools/ctcr/_core)
  target_link_libraries(${target} PRIVATE ctcr::calibration ctcr_flags)
  target_compile_options(${target} PRIVATE ${ARGN})
  target_precompile_headers(${target} PRIVATE <Eigen/Dense>)
  target_compile_definitions(${target} PRIVATE CTCR_VERSION="${PROJECT_VERSION}")
  install(TARGETS ${target} LIBRARY DESTINATION ${folder} COMPONENT python)
endfunction()

add_core(core ctcr)
nanobind_add_stub(core_stub MODULE _core OUTPUT _core.pyi PYTHON_PATH $<TARGET_FILE_DIR:core> DEPENDS core)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/_core.pyi DESTINATION ctcr COMPONENT python)

# A package that may travel is compiled for any processor, and once more for those with AVX2 and FMA, where it is four
# times as fast: tools/ctcr/__init__.py picks.
if(NOT CTCR_ARCH AND NOT MSVC AND CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  add_core(core_x86_64_v3 ctcr/_x86_64_v3 -march=x86-64-v3)
endif()

# The files of `ctcr demo`, which stand in the examples of a checkout.
install(FILES examples/data/demo/robot.yaml examples/data/demo/measurements.csv DESTINATION ctcr/demo/effect COMPONENT python)
