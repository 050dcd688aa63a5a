# Lets ${program} count its uses of the heap: the sources of the guard, and the linker options that it stands on.
target_sources(${program} PRIVATE ${CMAKE_CURRENT_LIST_DIR}/no_alloc.cpp)
set_source_files_properties(${CMAKE_CURRENT_LIST_DIR}/no_alloc.cpp PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
foreach(function malloc calloc realloc aligned_alloc posix_memalign free)
  target_link_options(${program} PRIVATE LINKER:--wrap=${function})
endforeach()
