include(${CMAKE_CURRENT_LIST_DIR}/../support/solver.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/../support/catalogue.cmake)
