#pragma once
#include <algorithm>
#include <span>
#include <vector>

#include "ctcr/recording/path.hpp"

namespace ctcr::detail {

/// The samples of a path at which friction is solved, its nodes. Of a dense recording they are some of the samples, else all.
/// Between two nodes the joints move straight on under the same load, and the torsion that the path brings is linear; what
/// friction adds to it is taken to be linear, too. Where the motion turns, friction changes fast: there every sample is a node.
/// From there on the distance between nodes doubles, up to a largest one.
template <int N>
class PathNodes {
  using Place = Eigen::Vector<double, 2 * N>;  // alpha [rad], then beta [m]

  // Largest distance between nodes [rad], [m].
  static constexpr double rotation = 0.0175, translation = 3.5e-4;
  // By which a motion may bend and still be straight [rad], [m], as in settings.PATH_STRAIGHT of the Python tools: a slide
  // by the radius of a tube changes friction as much as a turn of 1 rad.
  static constexpr double bent = 1.5e-3, slid = 2e-6;
  // By which a torsion may bend and still be linear [rad].
  static constexpr double twisted = 5e-3;
  // Samples from node to node, at most: it bounds the work.
  static constexpr std::size_t most = 64;

public:
  PathNodes(std::span<const RecordedRow<N>> rows, const RecordedPath<N>& path) : rows_(rows), path_(path) {
    const std::size_t count = path.q.size();
    double travelled = 0;  // since the motion turned, in largest distances
    for (std::size_t k = 0, next; k < count; k = next) {
      nodes_.push_back(k);
      bool straight = true;
      const double farthest = std::min(travelled, 1.0);
      for (next = k + 1; next + 1 < count && next - k < most; ++next)
        if (!(straight = is_straight(k, next + 1)) || distance(k, next + 1) > farthest) break;
      if (next < count) travelled = straight ? travelled + distance(k, next) : 0;
    }
  }

  [[nodiscard]] std::size_t size() const noexcept { return nodes_.size(); }
  [[nodiscard]] std::size_t operator[](std::size_t i) const noexcept { return nodes_[i]; }

  /// Calls f(k, a, b, part) for each sample k between two nodes a and b, `part` of the way from a to b.
  void for_each_between(const auto& f) const {
    for (std::size_t i = 0; i + 1 < nodes_.size(); ++i)
      for (std::size_t k = nodes_[i] + 1; k < nodes_[i + 1]; ++k)
        f(k, nodes_[i], nodes_[i + 1], part(k, nodes_[i], nodes_[i + 1]));
  }

private:
  [[nodiscard]] Place place(std::size_t k) const noexcept {
    const auto& q = path_.q[k];
    Place place;
    place << VecN<N>::Map(q.alpha.data()), VecN<N>::Map(q.beta.data());
    return place;
  }
  [[nodiscard]] auto torsion(std::size_t k) const noexcept {
    return VecN<Contacts<N>::count>::Map(path_.q[k].torsion.data());
  }

  /// Of the joint that moves most, in largest distances.
  [[nodiscard]] double distance(std::size_t a, std::size_t b) const noexcept {
    const Place way = (place(b) - place(a)).cwiseAbs();
    return std::max(way.template head<N>().maxCoeff() / rotation, way.template tail<N>().maxCoeff() / translation);
  }
  /// Of the way from a to b, where k is nearest to it.
  [[nodiscard]] double part(std::size_t k, std::size_t a, std::size_t b) const noexcept {
    Place from = place(a), way = place(b) - from, here = place(k) - from;
    for (Place* both : {&way, &here}) both->template tail<N>() *= rotation / translation;
    return std::clamp(way.dot(here) / std::max(way.squaredNorm(), 1e-30), 0.0, 1.0);
  }
  [[nodiscard]] bool is_straight(std::size_t a, std::size_t b) const noexcept {
    const RecordedRow<N>&first = rows_[path_.index[a].row], &last = rows_[path_.index[b].row];
    if (last.at.run != first.at.run || last.load.force != first.load.force || last.load.moment != first.load.moment)
      return false;
    for (std::size_t k = a + 1; k < b; ++k) {
      const double p = part(k, a, b);
      const auto off = [&](const auto& of) { return (of(k) - (1 - p) * of(a) - p * of(b)).cwiseAbs().eval(); };
      const Place aside = off([&](std::size_t i) { return place(i); });
      if (aside.template head<N>().maxCoeff() > bent || aside.template tail<N>().maxCoeff() > slid ||
          off([&](std::size_t i) { return torsion(i); }).maxCoeff() > twisted)
        return false;
    }
    return true;
  }

  std::span<const RecordedRow<N>> rows_;
  const RecordedPath<N>& path_;
  std::vector<std::size_t> nodes_;
};

}  // namespace ctcr::detail
