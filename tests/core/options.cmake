# Options with which numbers would be wrong are refused at compile time, with a sentence.
if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
  foreach(flag -ffast-math -Ofast -ffinite-math-only)
    add_test(NAME core/refuses${flag}
             COMMAND ${CMAKE_CXX_COMPILER} -std=c++20 ${flag} -fsyntax-only -I ${PROJECT_SOURCE_DIR}/include -x c++
                     ${PROJECT_SOURCE_DIR}/include/ctcr/math/sincos.hpp)
    set_tests_properties(core/refuses${flag} PROPERTIES LABELS core PASS_REGULAR_EXPRESSION "compile without -ffast-math")
  endforeach()
endif()
