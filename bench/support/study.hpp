#pragma once
// Bits of the accuracy study: running statistics and a markdown table.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <initializer_list>
#include <string>

namespace bench {

/// Mean and largest of a set of errors.
struct Errors {
  double sum = 0, max = 0;
  int count = 0;

  void add(double error) noexcept {
    sum += error;
    max = std::max(max, std::isfinite(error) ? error : HUGE_VAL);
    ++count;
  }
  [[nodiscard]] double mean() const noexcept { return sum / count; }
};

inline std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.2g", value);
  return buffer;
}

inline void print_row(std::initializer_list<std::string> cells) {
  for (const std::string& cell : cells) std::printf("| %s ", cell.c_str());
  std::puts("|");
}

/// Title, header line and rule of a markdown table.
inline void print_header(const char* title, std::initializer_list<std::string> cells) {
  std::printf("\n### %s\n\n", title);
  print_row(cells);
  for (std::size_t i = 0; i < cells.size(); ++i) std::printf("|---");
  std::puts("|");
}

}  // namespace bench
