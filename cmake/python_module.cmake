# The Python module ctcr._core and its typed stub; pip installs both beside the Python sources in tools/ctcr.
file(GLOB sources CONFIGURE_DEPENDS tools/ctcr/_core/*.cpp)
if(NOT sources)
  return()
endif()

find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module)
execute_process(COMMAND ${Python_EXECUTABLE} -m nanobind --cmake_dir OUTPUT_VARIABLE nanobind_ROOT
                OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
find_package(nanobind CONFIG REQUIRED)

nanobind_add_module(_core NB_STATIC NOMINSIZE NB_DOMAIN ctcr ${sources})
# Two numbers of tubes as one file to the compiler: a quarter less time.
set_target_properties(_core PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
foreach(part control model recording)
  foreach(tubes 1 2)
    math(EXPR more "${tubes} + 2")
    set_source_files_properties(tools/ctcr/_core/${part}_of_${tubes}.cpp tools/ctcr/_core/${part}_of_${more}.cpp
                                PROPERTIES UNITY_GROUP ${part}_${tubes})
  endforeach()
endforeach()
target_link_libraries(_core PRIVATE ctcr::calibration ctcr_flags)
target_precompile_headers(_core PRIVATE <Eigen/Dense>)
target_compile_definitions(_core PRIVATE CTCR_VERSION="${PROJECT_VERSION}")
nanobind_add_stub(core_stub MODULE _core OUTPUT _core.pyi MARKER_FILE py.typed
                  PYTHON_PATH $<TARGET_FILE_DIR:_core> DEPENDS _core)

install(TARGETS _core LIBRARY DESTINATION ctcr COMPONENT python)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/_core.pyi ${CMAKE_CURRENT_BINARY_DIR}/py.typed
        DESTINATION ctcr COMPONENT python)
