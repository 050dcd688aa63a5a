# What is built, and how our own programs (tests, examples, benchmarks, Python module) are compiled.
# scikit-build-core sets SKBUILD when pip builds the Python package.

set(own_programs ${PROJECT_IS_TOP_LEVEL})
set(python_package OFF)
if(SKBUILD)
  set(own_programs OFF)
  set(python_package ON)
endif()
option(CTCR_CALIBRATION "Provide the target ctcr::calibration (needs Ceres's headers)" ${PROJECT_IS_TOP_LEVEL})
option(CTCR_BUILD_TESTS "Build the C++ tests (needs GoogleTest)" ${own_programs})
option(CTCR_BUILD_EXAMPLES "Build the C++ examples" ${own_programs})
option(CTCR_BUILD_BENCH "Build the benchmarks (needs Google Benchmark)" OFF)
option(CTCR_BUILD_PYTHON "Build the Python module (needs nanobind)" ${python_package})

# The default instruction set is the one with AVX2 and FMA, where the building machine runs it. A Python package that is
# not installed in place may travel to another machine, so it stays with the compiler's own default.
set(default_arch "")
if((own_programs OR SKBUILD_STATE STREQUAL "editable") AND NOT CMAKE_CROSSCOMPILING AND CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  include(CheckCXXSourceRuns)
  check_cxx_source_runs("
    int main() { return __builtin_cpu_supports(\"avx2\") && __builtin_cpu_supports(\"fma\") ? 0 : 1; }"
    CTCR_HOST_HAS_AVX2)
  if(CTCR_HOST_HAS_AVX2)
    set(default_arch x86-64-v3)
  endif()
endif()
set(CTCR_ARCH "${default_arch}" CACHE STRING "-march of our own programs; empty: the compiler's default")

# Flags of our own programs; a user of ctcr::ctcr gets none of them.
add_library(ctcr_flags INTERFACE)
if(NOT MSVC)
  target_compile_options(ctcr_flags INTERFACE
    -Wall -Wextra -Wpedantic -Wshadow
    -Wno-psabi  # four lanes are passed differently with and without AVX; they never leave one program
    -ffp-contract=fast  # with -std=c++20 GCC would not use FMA instructions
    # GCC starts to collect garbage at 128 MB. Its peak is 2 GB either way, and collecting takes a sixth of its time.
    "$<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=500000>"  # [kB]
    "$<$<BOOL:${CTCR_ARCH}>:-march=${CTCR_ARCH}>")
endif()

# Tests and examples are compiled more often than they run.
add_library(ctcr_fast_compile INTERFACE)
target_link_libraries(ctcr_fast_compile INTERFACE ctcr_flags)
target_compile_definitions(ctcr_fast_compile INTERFACE CTCR_FAST_COMPILE)
target_compile_options(ctcr_fast_compile INTERFACE $<$<CONFIG:Release>:-O1>)

if(PROJECT_IS_TOP_LEVEL)
  set(CMAKE_CXX_EXTENSIONS OFF)
  find_program(CCACHE_PROGRAM ccache)
  if(CCACHE_PROGRAM AND NOT DEFINED CMAKE_CXX_COMPILER_LAUNCHER)
    set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
  endif()
endif()
