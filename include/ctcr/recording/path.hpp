#pragma once
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "ctcr/recording/row.hpp"
#include "ctcr/robot/parameters.hpp"

namespace ctcr::detail {

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

/// The path that the joints went, place after place on the way to each row.
/// @param seed  gives values of the transmission derivatives, by their place in ParameterVector<N>
template <int N, class P>
struct RecordedPath {
  std::vector<typename Path<N, P>::Row> q;
  std::vector<double> time;        ///< [s]; empty where it is not known of each row
  std::vector<std::size_t> end;    ///< place of each row
  std::vector<std::size_t> first;  ///< as in Path; with the clock a run begins anew
  ContactRadii<N> radius;

  RecordedPath(const Transmission<N>& transmission, std::span<const RecordedRow<N>> rows, const auto& seed) {
    for (std::size_t row = 0; row < rows.size(); ++row) {
      const std::size_t last = q.size() + rows[row].places() - 1;
      const bool begins =
          row == 0 || rows[row].at.run != rows[row - 1].at.run || !(rows[row].at.time > rows[row - 1].at.time);
      first.resize(last + 1, begins ? last : first.back());
      for (std::size_t place = 0; place < rows[row].places(); ++place) {
        const RecordedRow<N> here = ctcr::on_the_way(rows, row, place);
        auto& now = q.emplace_back();
        joints_of<N, P>(transmission, here.theta, seed, now.beta, now.alpha);
        if (!rows[row].twist.empty()) std::ranges::copy(rows[row].twist[place], now.twist.begin());
        if (!rows[row].jumps.empty()) now.jumps = rows[row].jumps[place];
        if (std::isfinite(here.at.time)) time.push_back(here.at.time);
      }
      end.push_back(q.size() - 1);
    }
    if (time.size() < q.size()) time.clear();
    if (!rows.empty()) radius = rows.front().radius;
  }

  /// What stands at a place.
  [[nodiscard]] RecordedRow<N> standing_at(std::span<const RecordedRow<N>> rows, std::size_t place) const {
    const auto row = std::size_t(std::ranges::lower_bound(end, place) - end.begin());
    return ctcr::on_the_way(rows, row, way(rows, row, place));
  }
  /// Of a place on the way to a row, its number there.
  [[nodiscard]] std::size_t way(std::span<const RecordedRow<N>> rows, std::size_t row,
                                std::size_t place) const noexcept {
    return place + rows[row].places() - 1 - end[row];
  }

  operator Path<N, P>() const noexcept { return {q, time, first, radius}; }
};

}  // namespace ctcr::detail
