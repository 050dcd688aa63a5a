#pragma once
// Elimination of the unknowns of a small linear system whose rows are groups of lanes.
#include <cmath>
#include <utility>

#include "ctcr/math/lanes.hpp"

namespace ctcr {

/// One row of coefficients, four to a group.
template <int G>
struct LaneRow {
  Lanes x[G];

  CTCR_INLINE double operator[](int lane) const noexcept { return x[lane / lane_count][lane % lane_count]; }
  CTCR_INLINE void add(int lane, double value) noexcept { x[lane / lane_count] += value * unit_lane(lane % lane_count); }
};

namespace detail {

template <int Step, int M, int R, int G, class Lane>
CTCR_INLINE void eliminate(LaneRow<G> (&row)[R], const Lane& lane, double& det) noexcept {
  if constexpr (Step < M) {
    constexpr int column = Lane{}(Step);
    double pivot = row[Step][column];
    if (std::abs(pivot) < 0.05) [[unlikely]] {
      int best = Step;
      for (int r = Step + 1; r < M; ++r)
        if (std::abs(row[r][column]) > std::abs(row[best][column])) best = r;
      if (best != Step) {
        std::swap(row[best], row[Step]);
        det = -det;
        pivot = row[Step][column];
      }
    }
    det *= pivot;
    const double inverse = std::abs(pivot) > 1e-100 ? 1.0 / pivot : 0.0;
    for (int g = 0; g < G; ++g) row[Step].x[g] = row[Step].x[g] * inverse;
    for (int r = 0; r < R; ++r) {
      if (r == Step) continue;
      const double f = row[r][column];
      for (int g = 0; g < G; ++g) row[r].x[g] = row[r].x[g] - f * row[Step].x[g];
    }
    eliminate<Step + 1, M>(row, lane, det);
  }
}

}  // namespace detail

/// Gauss-Jordan elimination: rows 0..M-1 are solved for the unknowns in lanes Lane(0..M-1), which are also removed from
/// the further rows. Rows keep their natural order while its pivots are sound, else rows are swapped.
/// @return determinant; 0: singular, the result is then finite but meaningless. Real time: yes.
template <int M, class Lane, int R, int G>
CTCR_INLINE double eliminate(LaneRow<G> (&row)[R], const Lane& lane) noexcept {
  double det = 1.0;
  detail::eliminate<0, M>(row, lane, det);
  return det;
}

}  // namespace ctcr
