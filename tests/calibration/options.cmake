include(${CMAKE_CURRENT_LIST_DIR}/../support/solver.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/../support/catalogue.cmake)
target_link_libraries(${program} PRIVATE ctcr::calibration)

add_test(NAME calibration/consumer
         COMMAND ${CMAKE_COMMAND} -D library=${PROJECT_BINARY_DIR} -D build=${CMAKE_CURRENT_BINARY_DIR}/calibration_consumer
                 -D generator=${CMAKE_GENERATOR} -D compiler=${CMAKE_CXX_COMPILER}
                 -P ${CMAKE_CURRENT_LIST_DIR}/consumer/run.cmake)
