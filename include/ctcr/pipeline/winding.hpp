#pragma once
// How the twist of tubes that rub changes with the parameters of what rubs them.
#include <Eigen/LU>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/mechanics/contact_twist.hpp"

namespace ctcr {

/// The twist at each place of a recording, near the parameters with which the tubes were wound up: linear in those of the
/// effect that follows it.
template <int N>
struct Winding {
  Eigen::VectorXd values;  ///< of these parameters, with which the tubes were wound up; empty: it is not known
  Eigen::MatrixXd slopes;  ///< (contacts x places, parameters)

  /// Adds to the twist at a place what other values change.
  template <class P>
  void extrapolate(const auto& to, std::size_t place, Twist<N, P>& twist) const noexcept {
    constexpr auto contacts = Eigen::Index(Contacts<N>::count);
    for (Eigen::Index j = 0; j < values.size(); ++j) {
      const P change = to[std::size_t(j)] - values[j];
      for (Eigen::Index c = 0; c < contacts; ++c)
        twist[std::size_t(c)] = twist[std::size_t(c)] + change * slopes(contacts * Eigen::Index(place) + c, j);
    }
  }
};

namespace detail {

template <class Effect>
class WindingSlopes;

/// Follows the slopes of the twist, and of what E remembers of it, from place to place.
template <int N, template <int, class> class E>
class WindingSlopes<E<N, double>> {
  static constexpr int count = E<N, double>::count, contacts = Contacts<N>::count;
  using Lane =
      Window<lane_groups(count + 1)>;  // of each parameter, and at last of the twist of each contact at a place
  using P = typename Lane::S;
  using Row = typename Path<N, P>::Row;

public:
  using Slopes = Eigen::Matrix<double, contacts, count>;

  WindingSlopes(const E<N, double>& effect, const ContactRadii<N>& radius) noexcept : radius_(radius) {
    for (int j = 0; j < count; ++j) effect_.values[std::size_t(j)] = Lane{}(effect.values[std::size_t(j)], j);
  }

  /// At a place, reached from the one before.
  /// @param there  what rubbing and parameters do to the twist, as twist_slopes() gives them; or null where there is no
  ///               equilibrium: then the twist keeps its slopes
  const Slopes& advance(const typename Path<N, double>::Row& from, const typename Path<N, double>::Row& to,
                        const TwistSlopes<N, count>* there) noexcept {
    std::array<Row, 2> q{row(from, slopes_), row(to, Slopes::Zero())};
    const Path<N, P> path{q, {}, {}, radius_};
    if (there) {
      E<N, P> moved = effect_;
      for (P& twist : q[1].twist) Lane{}.add(twist, count, 1);
      moved.remember(path, 1);
      Slopes rubbed;
      Eigen::Matrix<double, contacts, 1> law;  // slope of what is rubbed at each contact by its own twist
      for (int c = 0; c < contacts; ++c) {
        const P& h = moved.past.state[std::size_t(c)];
        for (int j = 0; j < count; ++j) rubbed(c, j) = h.d[j / lane_count][j % lane_count];
        law[c] = h.d[count / lane_count][count % lane_count];
      }
      const Eigen::Matrix<double, contacts, contacts> left =
          Eigen::Matrix<double, contacts, contacts>::Identity() - there->by_rubbing * law.asDiagonal();
      slopes_ = left.partialPivLu().solve(there->by_rubbing * rubbed + there->by_values);
    }
    q[1] = row(to, slopes_);
    effect_.remember(path, 1);
    return slopes_;
  }

private:
  static Row row(const typename Path<N, double>::Row& plain, const Slopes& slopes) noexcept {
    Row r;
    for (std::size_t i = 0; i < std::size_t(N); ++i) r.beta[i] = plain.beta[i], r.alpha[i] = plain.alpha[i];
    for (int c = 0; c < contacts; ++c) {
      P& twist = r.twist[std::size_t(c)] = plain.twist[std::size_t(c)];
      for (int j = 0; j < count; ++j) Lane{}.add(twist, j, slopes(c, j));
    }
    r.jumps = plain.jumps;
    return r;
  }

  E<N, P> effect_;
  Slopes slopes_ = Slopes::Zero();
  ContactRadii<N> radius_;
};

}  // namespace detail

}  // namespace ctcr
