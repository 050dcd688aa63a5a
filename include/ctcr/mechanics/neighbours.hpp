#pragma once
// Tips of robots that differ little from one that is solved, four at a time.
//
// Four equilibria are integrated together, in values alone, a fraction of the work of Newton's method. The Jacobian
// that this leaves out is that of the solved robot; each robot corrects it by what its own steps find, so that
// convergence is faster than linear. Ref: Broyden 1965. For the paper's robot, its parameters off by the paper's ranges
// and 0.3 N at its tip, 3.6 evaluations are good to 5e-8 m.
#include "ctcr/math/four.hpp"
#include "ctcr/math/small_solve.hpp"
#include "ctcr/mechanics/solve.hpp"

namespace ctcr {

/// A robot near a solved one, and where its joints are.
template <int N>
struct Neighbour {
  const Coefficients<N>* coefficients = nullptr;
  Joints<N> q;
  Events<N> events;

  Neighbour() = default;
  /// @param c  must outlive this. Real time: yes.
  Neighbour(const Coefficients<N>& c, const Joints<N>& at) noexcept
    : coefficients(&c), q(at), events(sort_events(c, at.beta)) {}

  /// Whether its tubes end and curve in the same order as those of another. Real time: yes.
  [[nodiscard]] bool comparable(const Neighbour& other) const noexcept {
    bool same = events.id == other.events.id && coefficients->curved == other.coefficients->curved;
    for (std::size_t e = 0; e < 2 * N; ++e) same = same && (events.s[e] > 0) == (other.events.s[e] > 0);
    return same;
  }
};

/// Where the tip of a neighbour is.
struct NeighbourTip {
  Vec3 position = Vec3::Zero();  ///< base frame [m]
  bool solved = false;           ///< if not, solve() has to be asked
  int evaluations = 0;
};

/// Robots around a solved one, under the same force at the tip. L may be more general than the load.
template <int N, Loading L>
class Neighbours {
  static constexpr bool loaded = L != Loading::none, weighs = L == Loading::weight;
  static constexpr int turns = loaded ? 3 : 0, unknowns = turns + N - 1, rows = unknowns + 3;

public:
  using FourTips = std::array<NeighbourTip, lane_count>;
  using FourRobots = std::array<Neighbour<N>, lane_count>;
  static constexpr int most_evaluations = 12;
  static constexpr double tolerance = 2e-6;  ///< on ||b|| before the last correction [rad]
  static constexpr double least_det = 0.1;   ///< det B_u below which a solution is not trusted

  /// @param found, guess  solution and unknowns of the solved robot   @param force  [N]
  /// @param tube          whose tip is wanted
  /// Real time: yes, three integrations of four robots.
  Neighbours(const Neighbour<N>& solved, const Vec3& force, const Solution<N>& found, const TipGuess<N>& guess,
             int tube, const Steps<N>& steps) noexcept
    : force_(force), tube_(tube), steps_(steps), det_(found.stability) {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) start_.rotation[std::size_t(i)][std::size_t(j)] = found.rotation(i, j);
    for (int i = 0; i < N; ++i) start_.psi[std::size_t(i)] = guess.psi[i];
    if constexpr (unknowns > 0) differentiate(packed({solved, solved, solved, solved}));
  }

  /// @param robots  comparable() with each other, not necessarily with the solved one
  /// Where several equilibria are stable the one found may be another than solve() finds. Real time: yes, at most
  /// most_evaluations integrations of four robots.
  [[nodiscard]] FourTips solve(const FourRobots& robots) const noexcept {
    const Pack pack = packed(robots);
    FourTips tips;
    Unknowns x = start_;
    Gain K = gain_;
    Four det = det_;
    Row at = evaluate(pack, x);
    for (int used = 1;; ++used) {
      const Four left = square(at);
      bool all = true;
      for (int i = 0; i < lane_count; ++i) {
        NeighbourTip& tip = tips[std::size_t(i)];
        if (tip.solved) continue;
        tip.evaluations = used;
        tip.solved = left[i] < tolerance * tolerance && det[i] > least_det;
        for (std::size_t k = 0; tip.solved && k < 3; ++k) {
          tip.position[Eigen::Index(k)] = at[unknowns + k][i];
          for (std::size_t j = 0; j < unknowns; ++j) tip.position[Eigen::Index(k)] -= K[unknowns + k][j][i] * at[j][i];
        }
        all = all && tip.solved;
      }
      if (all || used == most_evaluations) return tips;
      Change dx;
      for (std::size_t k = 0; k < unknowns; ++k) {
        dx[k] = 0.0;
        for (std::size_t j = 0; j < unknowns; ++j) dx[k] = dx[k] - K[k][j] * at[j];
      }
      x = moved(x, dx);
      const Row before = at;
      at = evaluate(pack, x);
      correct(before, at, dx, K, det);
    }
  }

private:
  using Row = std::array<Four, rows>;  ///< residual b [rad], then the position of the tip [m]
  using Change = std::array<Four, unknowns>;
  using Gain = std::array<std::array<Four, unknowns>, rows>;  ///< change of unknowns and position by b

  struct Unknowns {
    std::array<Four3, 3> rotation;  ///< rows of R_base_tip
    std::array<Four, N> psi;
  };
  struct Pack {
    Coefficients<N, Four> c;
    Events<N> events;                    ///< of the first robot
    std::array<Four, 2 * N> arc_length;  ///< of each event, of all [m]
    std::array<Four, N> beta, alpha;
    Four3 gravity;
  };
  struct TipPositions {
    std::array<Four3, N> of{Four3{0, 0, 0}};
    CTCR_INLINE void keep(int tube, const Frame<Four>& at, const Four&) noexcept { of[std::size_t(tube)] = at.p; }
  };
  struct Values {
    static constexpr bool jacobian = false;
  };

  [[nodiscard]] static Pack packed(const FourRobots& robots) noexcept {
    Pack p;
    const auto c = [&](int i) -> const Coefficients<N>& { return *robots[std::size_t(i)].coefficients; };
    const auto each = [&](auto field) { return four([&](int i) { return field(c(i)); }); };
    for (std::size_t t = 0; t < N; ++t) {
      p.c.kz[t] = each([t](const auto& k) { return k.kz[t]; });
      p.c.a[t] = each([t](const auto& k) { return k.a[t]; });
      p.c.rho[t] = each([t](const auto& k) { return k.rho[t]; });
      p.c.compliance[t] = each([t](const auto& k) { return k.compliance[t]; });
      p.c.weight[t] = each([t](const auto& k) { return k.weight[t]; });
      p.beta[t] = four([&](int i) { return robots[std::size_t(i)].q.beta[Eigen::Index(t)]; });
      p.alpha[t] = four([&](int i) { return robots[std::size_t(i)].q.alpha[Eigen::Index(t)]; });
    }
    p.c.curved = c(0).curved;
    for (std::size_t k = 0; k < 3; ++k)
      p.gravity[k] = each([k](const auto& of) { return of.gravity[Eigen::Index(k)]; });
    p.events = robots[0].events;
    for (std::size_t e = 0; e < 2 * N; ++e)
      p.arc_length[std::size_t(p.events.id[e])] = four([&](int i) { return robots[std::size_t(i)].events.s[e]; });
    return p;
  }

  [[nodiscard]] static CTCR_INLINE Four square(const Row& row) noexcept {
    Four sum = 0.0;
    for (std::size_t j = 0; j < unknowns; ++j) sum += row[j] * row[j];
    return sum;
  }

  /// x + dx. The turn is a Cayley transform: a rotation exactly, by the angle to third order.
  [[nodiscard]] static CTCR_INLINE Unknowns moved(const Unknowns& x, const Change& dx) noexcept {
    Unknowns r = x;
    if constexpr (loaded) {
      const Four3 half{0.5 * dx[0], 0.5 * dx[1], 0.5 * dx[2]};
      const Four scale = 2.0 * inverse(1.0 + dot(half, half));
      for (std::size_t j = 0; j < 3; ++j) {
        const Four3 across = cross(half, {x.rotation[0][j], x.rotation[1][j], x.rotation[2][j]});
        const Four3 twice = cross(half, across);
        for (std::size_t i = 0; i < 3; ++i) r.rotation[i][j] += scale * (across[i] + twice[i]);
      }
    }
    for (std::size_t i = 1; i < N; ++i) r.psi[i] += dx[turns + i - 1];
    return r;
  }

  /// The gain at the start, by differences: it need not be exact.
  void differentiate(const Pack& pack) noexcept {
    constexpr double small = 1e-6;
    const Row at = evaluate(pack, start_);
    Eigen::Matrix<double, rows, unknowns> J;
    for (int first = 0; first < unknowns; first += lane_count) {
      Change dx;
      for (int j = 0; j < unknowns; ++j) dx[std::size_t(j)] = four([&](int i) { return first + i == j ? small : 0.0; });
      const Row there = evaluate(pack, moved(start_, dx));
      for (int i = 0; i < lane_count && first + i < unknowns; ++i)
        for (int k = 0; k < rows; ++k) J(k, first + i) = (there[std::size_t(k)][i] - at[std::size_t(k)][i]) / small;
    }
    using Square = Eigen::Matrix<double, unknowns, unknowns>;
    const Square inverse = solved<unknowns>(J.template topRows<unknowns>(), Square(Square::Identity()));
    J = (J * inverse).eval();
    J.template topRows<unknowns>() = inverse;
    for (int k = 0; k < rows; ++k)
      for (int j = 0; j < unknowns; ++j) gain_[std::size_t(k)][std::size_t(j)] = J(k, j);
  }

  CTCR_NOINLINE Row evaluate(const Pack& pack, const Unknowns& x) const noexcept {
    using Rod = Shooting<N, Four, Four, Four, loaded, weighs, MagnusRk4, Values>;
    RobotState<Four, N> y;
    y.psi = x.psi;
    y.w.fill(0.0);
    if constexpr (loaded) {
      y.m = {0.0, 0.0};
      for (std::size_t j = 0; j < 3; ++j) {
        const Four3 axis{x.rotation[0][j], x.rotation[1][j], x.rotation[2][j]};
        y.n[j] = dot(axis, {force_[0], force_[1], force_[2]});
        if constexpr (weighs) y.g[j] = dot(axis, pack.gravity);
      }
    }
    Frame<Four> f;
    TipPositions tips;
    const auto arc_length = [&](int event, double) noexcept { return pack.arc_length[std::size_t(event)]; };
    Rod::run(pack.c, pack.events, arc_length, 0.0, steps_, y, f, tips);

    Row out;
    std::array<Four, N> angle;
    for (std::size_t i = 0; i < N; ++i) angle[i] = y.psi[i] + pack.beta[i] * y.w[i];
    for (std::size_t i = 1; i < N; ++i) out[turns + i - 1] = (angle[i] - angle[0]) - (pack.alpha[i] - pack.alpha[0]);
    Four s, c;
    sincos(pack.alpha[0] - angle[0], s, c);
    const std::array<Four3, 3> R{Four3{c * f.x[0] - s * f.y[0], c * f.x[1] - s * f.y[1], c * f.x[2] - s * f.y[2]},
                                 Four3{s * f.x[0] + c * f.y[0], s * f.x[1] + c * f.y[1], s * f.x[2] + c * f.y[2]}, f.z};
    const Four3& tip = tips.of[std::size_t(tube_)];
    const Four3 arm{tip[0] - f.p[0], tip[1] - f.p[1], tip[2] - f.p[2]};
    for (std::size_t i = 0; i < 3; ++i) out[unknowns + i] = dot(R[i], arm);
    if constexpr (loaded)  // The sine of the turn from the guessed frame to this one.
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
        out[i] = 0.5 * (dot(R[k], x.rotation[j]) - dot(R[j], x.rotation[k]));
      }
    return out;
  }

  /// Broyden's update of the gain after the step dx, and of det B_u. Robots that no longer move keep theirs.
  static CTCR_INLINE void correct(const Row& before, const Row& after, const Change& dx, Gain& K, Four& det) noexcept {
    Row change;
    for (std::size_t k = 0; k < rows; ++k) change[k] = after[k] - before[k];
    Change v;
    Four along = 0.0, length = 0.0;
    for (std::size_t j = 0; j < unknowns; ++j) {
      v[j] = 0.0;
      for (std::size_t k = 0; k < unknowns; ++k) v[j] += dx[k] * K[k][j];
      along += v[j] * change[j];
      length += dx[j] * dx[j];
    }
    const auto moves = [&](int i) { return length[i] > 1e-24 && along[i] != 0; };
    const Four scale = four([&](int i) { return moves(i) ? 1 / along[i] : 0.0; });
    det = det * four([&](int i) { return moves(i) ? along[i] / length[i] : 1.0; });
    for (std::size_t k = 0; k < rows; ++k) {
      Four missing = k < unknowns ? dx[k] : change[k];
      for (std::size_t j = 0; j < unknowns; ++j) missing = missing - K[k][j] * change[j];
      missing = missing * scale;
      for (std::size_t j = 0; j < unknowns; ++j) K[k][j] += missing * v[j];
    }
  }

  Vec3 force_;
  int tube_;
  Steps<N> steps_;
  double det_;
  Unknowns start_;
  Gain gain_;
};

}  // namespace ctcr
