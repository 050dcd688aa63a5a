#pragma once
// How the tubes at one cross-section share the bending moment: the common curvature of the centreline that balances their
// moments, each by its constitutive law. For any scalar S.
#include <array>

#include "ctcr/math/functions.hpp"
#include "ctcr/mechanics/constitutive_law.hpp"
#include "ctcr/mechanics/effect_state.hpp"

namespace ctcr {

/// The tubes at one arc length of the robot.
template <int N, class S>
struct CrossSection {
  int present = 0;  ///< tubes 1..present
  std::array<bool, N> curved{};
  std::array<S, N> along;  ///< arc length of each present tube section [m]
  std::array<S, N> friction,
      friction_rate;  ///< torque per length on each tube from the next outer one [N], its derivative by arc length [N/m]
  std::array<Material<S>, N> material;  ///< of each present tube section
  std::array<double, 2> u{};  ///< curvature of the centreline a little further out, a start for iterations [1/m]
  bool knows_u = false;       ///< whether there is one
};

/// Curvatures and moments of the tubes under the bending moment of a state. Real time: yes.
template <int N, class S>
class MomentSharing {
public:
  using Section = CrossSection<N, S>;
  using State = EffectState<N, S>;

  std::array<S, 2> u;                         ///< curvature of the centreline, Bishop axes [1/m]
  std::array<S, N> sine, cosine;              ///< of psi
  std::array<std::array<S, 2>, N> curvature;  ///< of each tube, its own axes [1/m]
  std::array<std::array<S, 2>, N> moment;     ///< of each tube, its own axes [N m]

  /// @param varied  whether effects change the material of the tubes
  MomentSharing(const Section& section, const State& y, bool varied) noexcept {
    bool linear = true;
    for (int j = 0; j < section.present; ++j) {
      const auto i = std::size_t(j);
      sincos(y.psi(j), sine[i], cosine[i]);
      linear = linear && (!varied || constitutive::is_isotropic_and_linear(section.material[i]));
    }
    linear ? by_stiffness(section, y) : by_iteration(section, y);
  }

private:
  static constexpr int iterations = 12;  ///< convex and quadratic: 3 are usual

  /// Where all tubes are isotropic and linear, by one division.
  void by_stiffness(const Section& section, const State& y) noexcept {
    S stiffness = 0.0;
    std::array<S, 2> total{y.m(0), y.m(1)};
    for (std::size_t i = 0; i < std::size_t(section.present); ++i) {
      const Material<S>& m = section.material[i];
      const S &k = m.bending_stiffness, &s = sine[i], &c = cosine[i];
      const std::array<S, 2> q{k * m.curvature[0], k * m.curvature[1]};
      total = {total[0] + (c * q[0] - s * q[1]), total[1] + (s * q[0] + c * q[1])};
      stiffness = stiffness + k;
    }
    const S compliance = inverse(stiffness);
    u = {compliance * total[0], compliance * total[1]};
    for (std::size_t i = 0; i < std::size_t(section.present); ++i) {
      const Material<S>& m = section.material[i];
      const S &s = sine[i], &c = cosine[i];
      curvature[i] = {c * u[0] + s * u[1], c * u[1] - s * u[0]};
      for (std::size_t k = 0; k < 2; ++k) moment[i][k] = m.bending_stiffness * (curvature[i][k] - m.curvature[k]);
    }
  }

  /// The value by Newton's method; one more step of it with derivatives then makes both exact to rounding.
  void by_iteration(const Section& section, const State& y) noexcept {
    bool is_linear = true;
    for (std::size_t i = 0; i < std::size_t(section.present); ++i)
      is_linear = is_linear && value(section.material[i].softening) == 0;
    std::array<double, 2> at = section.knows_u && !is_linear ? section.u : without_softening(section, y);
    double left = is_linear ? 0 : 1;  // (relative change)^2
    for (int k = 0; k < iterations && left > 1e-8; ++k) {
      const auto change = newton_step(section, y, at);
      at = {at[0] + change[0], at[1] + change[1]};
      left = (change[0] * change[0] + change[1] * change[1]) / (1 + at[0] * at[0] + at[1] * at[1]);
    }
    // Derivatives at this curvature of the centreline, then along it: most factors have none.
    std::array<S, 2> rest{y.m(0), y.m(1)};
    constitutive::Slope slope;
    std::array<constitutive::Slope, N> own;
    for (std::size_t i = 0; i < std::size_t(section.present); ++i) {
      const Material<S>& m = section.material[i];
      const S turn = y.psi(int(i)) - value(y.psi(int(i)));
      const std::array<double, 2> w = seen_by_tube(i, at), free{value(m.curvature[0]), value(m.curvature[1])};
      const auto answer = constitutive::response<S>(m, w[0] - free[0], w[1] - free[1]);
      own[i] = answer.slope;
      curvature[i] = {w[0] + w[1] * turn, w[1] - w[0] * turn};
      const std::array<S, 2> change{(curvature[i][0] - w[0]) - (m.curvature[0] - free[0]),
                                    (curvature[i][1] - w[1]) - (m.curvature[1] - free[1])};
      const std::array<S, 2> more = own[i] * change;
      moment[i] = {answer.moment[0] + more[0], answer.moment[1] + more[1]};
      const std::array<S, 2> q = seen_from_tube(i, moment[i]);
      rest = {rest[0] - q[0] + value(q[1]) * turn, rest[1] - q[1] - value(q[0]) * turn};
      slope += own[i].turned(value(sine[i]), value(cosine[i]));
    }
    const std::array<S, 2> change = slope.inverted() * rest;
    u = {at[0] + change[0], at[1] + change[1]};
    for (std::size_t i = 0; i < std::size_t(section.present); ++i) {
      const std::array<S, 2> more = seen_by_tube(i, change), moment_more = own[i] * more;
      for (std::size_t k = 0; k < 2; ++k) {
        curvature[i][k] = curvature[i][k] + more[k];
        moment[i][k] = moment[i][k] + moment_more[k];
      }
    }
  }

  [[nodiscard]] std::array<double, 2> without_softening(const Section& section, const State& y) const noexcept {
    constitutive::Slope slope;
    std::array<double, 2> total{value(y.m(0)), value(y.m(1))};
    for (std::size_t i = 0; i < std::size_t(section.present); ++i) {
      const Material<S>& m = section.material[i];
      const constitutive::Slope unsoftened = constitutive::stiffness(m, 1.0);
      const auto q = seen_from_tube(i, unsoftened * std::array{value(m.curvature[0]), value(m.curvature[1])});
      total = {total[0] + q[0], total[1] + q[1]};
      slope += unsoftened.turned(value(sine[i]), value(cosine[i]));
    }
    return slope.inverted() * total;
  }

  /// Newton step of the curvature `at` towards balance [1/m].
  [[nodiscard]] std::array<double, 2> newton_step(const Section& section, const State& y,
                                                  const std::array<double, 2>& at) const noexcept {
    constitutive::Slope slope;
    std::array<double, 2> rest{value(y.m(0)), value(y.m(1))};
    for (std::size_t i = 0; i < std::size_t(section.present); ++i) {
      const Material<S>& m = section.material[i];
      const std::array<double, 2> w = seen_by_tube(i, at);
      const auto answer = constitutive::response<double>(m, w[0] - value(m.curvature[0]), w[1] - value(m.curvature[1]));
      const auto q = seen_from_tube(i, answer.moment);
      rest = {rest[0] - q[0], rest[1] - q[1]};
      slope += answer.slope.turned(value(sine[i]), value(cosine[i]));
    }
    return slope.inverted() * rest;
  }

  /// A vector of the Bishop frame in the axes of a tube, whose angle is taken for constant; and back.
  template <class T>
  [[nodiscard]] std::array<T, 2> seen_by_tube(std::size_t i, const std::array<T, 2>& v) const noexcept {
    const double s = value(sine[i]), c = value(cosine[i]);
    return {c * v[0] + s * v[1], c * v[1] - s * v[0]};
  }
  template <class T>
  [[nodiscard]] std::array<T, 2> seen_from_tube(std::size_t i, const std::array<T, 2>& v) const noexcept {
    const double s = value(sine[i]), c = value(cosine[i]);
    return {c * v[0] - s * v[1], s * v[0] + c * v[1]};
  }
};

}  // namespace ctcr
