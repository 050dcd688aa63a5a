#pragma once
// Dense linear systems of a few unknowns off the fastest paths.
#include <Eigen/Core>
#include <cmath>
#include <utility>

namespace ctcr {

/// Solves A X = B by Gaussian elimination with row pivots; X takes the place of B, which may have any number of columns.
/// Plain loops: Eigen's decompositions take the compiler seconds for each size.
/// @return |smallest pivot / largest pivot|; 0: A is singular or not finite, and B is meaningless. Real time: yes.
template <int n, class Columns>
double solve_in_place(Eigen::Matrix<double, n, n> A, Columns& B) noexcept {
  double smallest = HUGE_VAL, largest = 0;
  const auto columns = int(B.cols());
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(A(i, k)) > std::abs(A(pivot, k))) pivot = i;
    if (pivot != k) {
      for (int j = k; j < n; ++j) std::swap(A(k, j), A(pivot, j));
      for (int j = 0; j < columns; ++j) std::swap(B(k, j), B(pivot, j));
    }
    const double size = std::abs(A(k, k));
    if (!(size > 0 && size < HUGE_VAL)) return 0;
    smallest = size < smallest ? size : smallest;
    largest = size > largest ? size : largest;
    for (int i = k + 1; i < n; ++i) A(i, k) /= A(k, k);
    const auto eliminate = [&](auto& from, int j) {
      for (int i = k + 1; i < n; ++i) from(i, j) -= A(i, k) * from(k, j);
    };
    for (int j = k + 1; j < n; ++j) eliminate(A, j);
    for (int j = 0; j < columns; ++j) eliminate(B, j);
  }
  for (int j = 0; j < columns; ++j)
    for (int k = n; k-- > 0;) {
      B(k, j) /= A(k, k);
      for (int i = 0; i < k; ++i) B(i, j) -= A(i, k) * B(k, j);
    }
  return smallest / largest;
}

/// X of A X = B. Not finite, or meaningless, where A is singular. Real time: yes.
template <int n, class Columns>
[[nodiscard]] Columns solved(const Eigen::Matrix<double, n, n>& A, Columns B) noexcept {
  (void)solve_in_place(A, B);
  return B;
}

}  // namespace ctcr
