# The Python module ctcr._core and its typed stub; pip installs both beside the Python sources in tools/ctcr.
file(GLOB sources CONFIGURE_DEPENDS tools/ctcr/_core/*.cpp)
if(NOT sources)
  return()
endif()

find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module)
execute_process(COMMAND ${Python_EXECUTABLE} -m nanobind --cmake_dir OUTPUT_VARIABLE nanobind_ROOT
                OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
find_package(nanobind CONFIG REQUIRED)

# What takes long to compile, for 1 to 4 tubes.
foreach(part systems control model recording)
  string(TOUPPER ${part} PART)
  foreach(tubes 1 2)
    math(EXPR more_tubes "${tubes} + 2")
    set(instance ${CMAKE_CURRENT_BINARY_DIR}/_core/${part}_of_${tubes}_${more_tubes}.cpp)
    configure_file(tools/ctcr/_core/instantiate.cpp.in ${instance} @ONLY)
    list(APPEND sources ${instance})
  endforeach()
endforeach()

nanobind_add_module(_core NB_STATIC NOMINSIZE NB_DOMAIN ctcr ${sources})
target_include_directories(_core PRIVATE tools/ctcr/_core)
target_link_libraries(_core PRIVATE ctcr::calibration ctcr_flags)
target_precompile_headers(_core PRIVATE <Eigen/Dense>)
target_compile_definitions(_core PRIVATE CTCR_VERSION="${PROJECT_VERSION}")
nanobind_add_stub(core_stub MODULE _core OUTPUT _core.pyi PYTHON_PATH $<TARGET_FILE_DIR:_core> DEPENDS _core)

install(TARGETS _core LIBRARY DESTINATION ctcr COMPONENT python)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/_core.pyi DESTINATION ctcr COMPONENT python)
