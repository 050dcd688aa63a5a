include(${CMAKE_CURRENT_LIST_DIR}/../support/solver.cmake)
# The two builds of the model must not meet in one file.
set_target_properties(${program} PROPERTIES UNITY_BUILD OFF)
