# Gives ${program} the solvers of the library, and the further instantiations of support/solver.hpp, compiled once for all
# programs, in files of bearable size.
if(NOT TARGET ctcr_test_solver)
  # DIRECT is the slower twin that serves one test.
  foreach(instance SOLVER_WITH-compliance-5 TEST_PARAMETERS-all-3 TEST_PARAMETERS-all-2 TEST_PARAMETERS-all-1
                   TEST_DIRECT-compliance-3 TEST_DIRECT-jacobian-3 TEST_DIRECT-none-3
                   TEST_DIRECT-compliance-2 TEST_DIRECT-jacobian-2 TEST_DIRECT-none-2)
    string(REPLACE "-" ";" parts ${instance})
    list(GET parts 0 kind)
    list(GET parts 1 part)
    list(GET parts 2 tubes)
    configure_file(${CMAKE_CURRENT_LIST_DIR}/solver.cpp.in ${CMAKE_CURRENT_BINARY_DIR}/solver/${instance}.cpp @ONLY)
    list(APPEND instances ${CMAKE_CURRENT_BINARY_DIR}/solver/${instance}.cpp)
  endforeach()
  add_library(ctcr_test_solver STATIC ${instances})
  target_include_directories(ctcr_test_solver PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
  # GTest only because the precompiled header of the tests has it.
  target_link_libraries(ctcr_test_solver PRIVATE ctcr_fast_compile GTest::gtest PUBLIC ctcr_own_solver)
  target_precompile_headers(ctcr_test_solver REUSE_FROM ${precompiled})
  set_target_properties(ctcr_test_solver PROPERTIES UNITY_BUILD_BATCH_SIZE 3)
  unset(instances)
endif()
target_link_libraries(${program} PRIVATE ctcr_test_solver)
