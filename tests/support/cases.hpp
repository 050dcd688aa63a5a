#pragma once
#include <cstdlib>

namespace ctcr::test {

/// How many random cases a test tries: CTCR_TEST_CASES where it is set, else `usual`.
inline int cases(int usual) {
  const char* wanted = std::getenv("CTCR_TEST_CASES");
  return wanted ? std::atoi(wanted) : usual;
}

}  // namespace ctcr::test
