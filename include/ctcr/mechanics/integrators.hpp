#pragma once
// Textbook explicit Runge-Kutta schemes, for comparison with the default (steppers.hpp): Stepper arguments of solve().
// They integrate the whole state as plain ordinary differential equations, position and rotation matrix included, so
// the rotation drifts from orthogonality as far as the scheme errs. Ref: Boyer et al., Figure 2.
// Real time: yes.
#include "ctcr/mechanics/steppers.hpp"

namespace ctcr {

/// An explicit scheme by its Butcher tableau: `order`, `stages`, a[i][j] for j < i, weights b[j].
template <class Tableau>
struct RungeKutta {
  static constexpr bool has_tangent_pass = false;
  static constexpr bool general_equations = true;  ///< those with load and weight, whatever acts: compiled once

  template <bool Gravity, class S, class P, int NC, class F, class H>
  static void loaded(const RodSection<S, P, NC>& r, RodState<S, NC>& y, F& frame, const H& k) noexcept {
    Rod<true, Gravity, S, P, NC>::step(r, y, frame, k);
  }
  template <class S, class P, int NC, class F, class H>
  static void unloaded(const RodSection<S, P, NC>& r, RodState<S, NC>& y, F& frame, const H& k) noexcept {
    Rod<false, false, S, P, NC>::step(r, y, frame, k);
  }

private:
  template <bool Loaded, bool Gravity, class S, class P, int NC>
  struct Rod {
    using Section = RodSection<S, P, NC>;
    using State = RodState<S, NC>;

    // Indices in the vector that is integrated. The frame is that relative to the start of the step: R by columns, p.
    static constexpr std::size_t psi = 0, w = NC, R = 2 * NC, p = R + 9, m = p + 3, n = m + 2, g = n + 3;
    static constexpr std::size_t size = Gravity ? g + 3 : (Loaded ? g : m);
    using Vector = std::array<S, size>;

    template <std::size_t count>
    static void put(Vector& x, std::size_t at, const std::array<S, count>& part) noexcept {
      for (std::size_t i = 0; i < count; ++i) x[at + i] = part[i];
    }
    template <std::size_t count>
    static void take(const Vector& x, std::size_t at, std::array<S, count>& part) noexcept {
      for (std::size_t i = 0; i < count; ++i) part[i] = x[at + i];
    }
    /// All but the frame. `Wrench` is a RodState or a RodRates.
    template <class Wrench>
    static void pack(Vector& x, const std::array<S, NC>& psi_part, const std::array<S, NC>& w_part,
                     const Wrench& y) noexcept {
      put(x, psi, psi_part);
      put(x, w, w_part);
      if constexpr (Loaded) put(x, m, y.m), put(x, n, y.n);
      if constexpr (Gravity) put(x, g, y.g);
    }
    static void unpack(const Vector& x, State& y) noexcept {
      take(x, psi, y.psi);
      take(x, w, y.w);
      if constexpr (Loaded) take(x, m, y.m), take(x, n, y.n);
      if constexpr (Gravity) take(x, g, y.g);
    }

    static Vector rates(const Section& r, const Vector& x) noexcept {
      State y;
      unpack(x, y);
      RodRates<S, NC> k;
      if constexpr (Loaded) {
        k = loaded_rates<Gravity>(r, y);
      } else {
        k.F.fill(0.0);
        curvature<false>(r, y.psi, y.m, k);
      }
      Vector d;
      pack(d, y.w, k.F, k);
      for (std::size_t i = 0; i < 3; ++i) {  // R' = R u^, p' = R e3
        const S &X = x[R + i], &Y = x[R + 3 + i], &Z = x[R + 6 + i];
        d[R + i] = -(k.u[1] * Z);
        d[R + 3 + i] = k.u[0] * Z;
        d[R + 6 + i] = k.u[1] * X - k.u[0] * Y;
        d[p + i] = Z;
      }
      return d;
    }

    template <class H>
    static void step(const Section& r, State& y, Frame<S>& frame, const H& k) noexcept {
      Vector start;
      pack(start, y.psi, y.w, y);
      for (std::size_t i = 0; i < 9; ++i) start[R + i] = i % 4 == 0 ? 1.0 : 0.0;
      for (std::size_t i = 0; i < 3; ++i) start[p + i] = 0.0;

      std::array<Vector, Tableau::stages> d;
      const auto moved = [&](const double* weight, std::size_t stages) noexcept {
        Vector x;
        for (std::size_t i = 0; i < size; ++i) {
          S sum = 0.0;
          for (std::size_t j = 0; j < stages; ++j)
            if (weight[j] != 0) sum = sum + weight[j] * d[j][i];
          x[i] = start[i] + k * sum;
        }
        return x;
      };
      for (std::size_t i = 0; i < Tableau::stages; ++i) d[i] = rates(r, moved(Tableau::a[i], i));
      const Vector end = moved(Tableau::b, Tableau::stages);
      unpack(end, y);
      move(frame, &end[R], &end[p]);
    }

    /// g <- g (R, p): the frame's equations are linear, so this is the scheme applied to the frame itself.
    static void move(Frame<S>& frame, const S* R_step, const S* p_step) noexcept {
      const Lanes x = frame.x, y = frame.y, z = frame.z;
      const auto turned = [&](const S* v) { return x * value(v[0]) + y * value(v[1]) + z * value(v[2]); };
      frame.p += turned(p_step);
      frame.x = turned(R_step);
      frame.y = turned(R_step + 3);
      frame.z = turned(R_step + 6);
      if constexpr (is_dual<S>)
        for (std::size_t group = 0; group < std::size_t(groups_of<S>); ++group)
          move_twist(frame, R_step, p_step, group);
    }

    /// Rotation R^T f + vee(R^T dR), translation R^T (t + f x p + dp).
    static void move_twist(Frame<S>& frame, const S* R_step, const S* p_step, std::size_t group) noexcept {
      auto &rotation = frame.rotation_twist, &translation = frame.translation_twist;
      const auto along = [&](std::size_t column, const Lanes(&v)[3]) {
        const S* c = R_step + 3 * column;
        return value(c[0]) * v[0] + value(c[1]) * v[1] + value(c[2]) * v[2];
      };
      Lanes f[3], t[3], dR[3][3];
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t j = (i + 1) % 3, l = (i + 2) % 3;
        f[i] = rotation[i][group];
        t[i] = translation[i][group] + rotation[j][group] * value(p_step[l]) - rotation[l][group] * value(p_step[j]) +
               p_step[i].d[group];
        for (std::size_t column = 0; column < 3; ++column) dR[column][i] = R_step[3 * column + i].d[group];
      }
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t j = (i + 1) % 3, l = (i + 2) % 3;
        rotation[i][group] = along(i, f) + 0.5 * (along(l, dR[j]) - along(j, dR[l]));
        translation[i][group] = along(i, t);
      }
    }
  };
};

struct SspRk3Tableau {
  static constexpr int order = 3;
  static constexpr std::size_t stages = 3;
  static constexpr double a[stages][stages] = {{}, {1}, {1. / 4, 1. / 4}};
  static constexpr double b[stages] = {1. / 6, 1. / 6, 2. / 3};
};
struct ClassicalRk4Tableau {
  static constexpr int order = 4;
  static constexpr std::size_t stages = 4;
  static constexpr double a[stages][stages] = {{}, {1. / 2}, {0, 1. / 2}, {0, 0, 1}};
  static constexpr double b[stages] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
};
struct PrinceDormandTableau {
  static constexpr int order = 8;
  static constexpr std::size_t stages = 13;
  static constexpr double a[stages][stages] = {
      {},
      {1. / 18},
      {1. / 48, 1. / 16},
      {1. / 32, 0, 3. / 32},
      {5. / 16, 0, -75. / 64, 75. / 64},
      {3. / 80, 0, 0, 3. / 16, 3. / 20},
      {29443841. / 614563906, 0, 0, 77736538. / 692538347, -28693883. / 1125000000, 23124283. / 1800000000},
      {16016141. / 946692911, 0, 0, 61564180. / 158732637, 22789713. / 633445777, 545815736. / 2771057229,
       -180193667. / 1043307555},
      {39632708. / 573591083, 0, 0, -433636366. / 683701615, -421739975. / 2616292301, 100302831. / 723423059,
       790204164. / 839813087, 800635310. / 3783071287},
      {246121993. / 1340847787, 0, 0, -37695042795. / 15268766246, -309121744. / 1061227803, -12992083. / 490766935,
       6005943493. / 2108947869, 393006217. / 1396673457, 123872331. / 1001029789},
      {-1028468189. / 846180014, 0, 0, 8478235783. / 508512852, 1311729495. / 1432422823, -10304129995. / 1701304382,
       -48777925059. / 3047939560, 15336726248. / 1032824649, -45442868181. / 3398467696, 3065993473. / 597172653},
      {185892177. / 718116043, 0, 0, -3185094517. / 667107341, -477755414. / 1098053517, -703635378. / 230739211,
       5731566787. / 1027545527, 5232866602. / 850066563, -4093664535. / 808688257, 3962137247. / 1805957418,
       65686358. / 487910083},
      {403863854. / 491063109, 0, 0, -5068492393. / 434740067, -411421997. / 543043805, 652783627. / 914296604,
       11173962825. / 925320556, -13158990841. / 6184727034, 3936647629. / 1978049680, -160528059. / 685178525,
       248638103. / 1413531060}};
  static constexpr double b[stages] = {14005451. / 335480064,
                                       0,
                                       0,
                                       0,
                                       0,
                                       -59238493. / 1068277825,
                                       181606767. / 758867731,
                                       561292985. / 797845732,
                                       -1041891430. / 1371343529,
                                       760417239. / 1151165299,
                                       118820643. / 751138087,
                                       -528747749. / 2220607170,
                                       1. / 4};
};

/// Third order, strong stability preserving. Ref: Shu & Osher 1988.
using SspRk3 = RungeKutta<SspRk3Tableau>;
/// The classical fourth-order scheme. Ref: Kutta 1901.
using ClassicalRk4 = RungeKutta<ClassicalRk4Tableau>;
/// The eighth-order formula of RK8(7)13M. Ref: Prince & Dormand 1981, Table 2.
using PrinceDormand8 = RungeKutta<PrinceDormandTableau>;

}  // namespace ctcr
