# ctcr::solver_1 to ctcr::solver_4: the solver for robots of so many tubes, without effects, becomes a source file of the
# program that links the target, and takes its flags. The other files then only call it, and compile in a fifth of the time
# (include/ctcr/mechanics/solver_instances.hpp).
include(GNUInstallDirs)

set(solver_sources ${CMAKE_INSTALL_DATADIR}/ctcr/src)
foreach(tubes 1 2 3 4)
  set(target ctcr_solver_${tubes})
  set(source solver_of_${tubes}.cpp)
  add_library(${target} INTERFACE)
  add_library(ctcr::solver_${tubes} ALIAS ${target})
  target_link_libraries(${target} INTERFACE ctcr::ctcr)
  set(definition CTCR_SOLVER_${tubes})
  target_compile_definitions(${target} INTERFACE ${definition})
  target_sources(${target} INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src/${source}>
                                     $<INSTALL_INTERFACE:$<INSTALL_PREFIX>/${solver_sources}/${source}>)
  set_target_properties(${target} PROPERTIES EXPORT_NAME solver_${tubes})
  list(APPEND solvers ${target})
  list(APPEND definitions ${definition})
  install(FILES src/${source} DESTINATION ${solver_sources})
endforeach()
install(TARGETS ${solvers} EXPORT ctcr-targets)

# All of them, compiled once for tests and examples.
if(CTCR_BUILD_TESTS OR CTCR_BUILD_EXAMPLES)
  add_library(ctcr_own_solver STATIC)
  target_link_libraries(ctcr_own_solver PRIVATE ${solvers} ctcr_fast_compile INTERFACE ctcr::ctcr)
  set_target_properties(ctcr_own_solver PROPERTIES UNITY_BUILD OFF)  # side by side, and in less memory
  target_compile_definitions(ctcr_own_solver INTERFACE ${definitions})
endif()
