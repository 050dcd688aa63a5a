include(${CMAKE_CURRENT_LIST_DIR}/no_alloc.cmake)
# The guard must hold against the strongest optimiser.
target_compile_options(${program} PRIVATE $<$<CONFIG:Release>:-O3>)
