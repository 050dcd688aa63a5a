#pragma once
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "ctcr/recording/row.hpp"
#include "ctcr/robot/parameters.hpp"

namespace ctcr {

namespace detail {

/// Joints of motor angles. @param seed  seed(x, index in ParameterVector<N>) gives a value of the transmission derivatives
template <int N, class S>
void joints_of(const Transmission<N>& t, const MotorAngles<N>& theta, const auto& seed, std::array<S, N>& beta,
               std::array<S, N>& alpha) noexcept {
  using P = ParameterVector<N>;
  const S translation = seed(t.translation_ratio, P::index(Parameter::translation_ratio));
  const S rotation = seed(t.rotation_ratio, P::index(Parameter::rotation_ratio));
  for (int i = 0; i < N; ++i) {
    beta[std::size_t(i)] =
        translation * theta.translation[i] + seed(t.home_translation[i], P::index(Parameter::home_translation, i));
    alpha[std::size_t(i)] =
        rotation * theta.rotation[i] + seed(t.home_rotation[i], P::index(Parameter::home_rotation, i));
  }
}

}  // namespace detail

/// The path of the joints along a recording: the samples of all rows, one after the other.
template <int N, class P = double>
struct RecordedPath {
  /// Where a sample lies: sample `of_row` of the way to row `row`.
  struct Index {
    std::size_t row, of_row;
  };
  std::vector<typename Path<N, P>::Row> q;  ///< joints, torsion and moment jumps at each sample
  std::vector<Index> index;                 ///< of each sample
  std::vector<std::size_t> end;             ///< sample at which each row stands
  std::vector<double> time;                 ///< of each sample [s]; empty unless it is known of all
  std::vector<std::size_t> first;           ///< as in Path; a run begins anew with the clock
  ContactRadii<N> radius;

  /// @param seed  as joints_of() takes it
  RecordedPath(const Transmission<N>& transmission, std::span<const RecordedRow<N>> rows, const auto& seed) {
    for (std::size_t row = 0; row < rows.size(); ++row) {
      const std::size_t samples = rows[row].samples(), last = q.size() + samples - 1;
      const bool begins =
          row == 0 || rows[row].at.run != rows[row - 1].at.run || !(rows[row].at.time > rows[row - 1].at.time);
      first.resize(last + 1, begins ? last : first.back());
      for (std::size_t sample = 0; sample < samples; ++sample) {
        const RecordedRow<N> here = sample_of(rows, row, sample);
        auto& now = q.emplace_back();
        index.push_back({row, sample});
        detail::joints_of<N, P>(transmission, here.theta, seed, now.beta, now.alpha);
        if (!rows[row].torsion.empty()) std::ranges::copy(rows[row].torsion[sample], now.torsion.begin());
        if (!rows[row].jumps.empty()) now.jumps = rows[row].jumps[sample];
        if (std::isfinite(here.at.time)) time.push_back(here.at.time);
      }
      end.push_back(last);
    }
    if (time.size() < q.size()) time.clear();
    if (!rows.empty()) radius = rows.front().radius;
  }

  /// Sample k as a row without torsion.
  [[nodiscard]] RecordedRow<N> sample(std::span<const RecordedRow<N>> rows, std::size_t k) const noexcept {
    return sample_of(rows, index[k].row, index[k].of_row);
  }

  operator Path<N, P>() const noexcept { return {q, time, first, radius}; }
};

}  // namespace ctcr
