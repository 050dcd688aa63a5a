// A home offset through the installed headers, and the one that includes Ceres.
#include <cmath>
#include <cstdio>
#include <ctcr/calibration/procedures/home.hpp>
#include <ctcr/calibration/procedures/small_problem.hpp>

int main() {
  const ctcr::Home home = ctcr::home_offsets({{{.distances = {0.3}, .lengths = {0.4}}}}, {.translation_ratio = 1e-3});
  const double error = std::abs(home.tubes.at(0).offset + 0.3);
  std::printf("%.1e m\n", error);
  return error < 1e-12 ? 0 : 1;
}
