#pragma once
// The control step with the columns of its one evaluation shared among threads, as in the paper's Table I.
//
// Measured with J and C, 3 tubes, 2 threads on 2 cores that had other work besides: medians of 3.4 us alone and 4.9 us
// split at one step per segment, 42 and 54 us at 16. The values, two fifths of the integration, are computed by every
// thread, so two threads on idle cores can save a fifth of it (0.5 us at one step per segment) less the hand-off
// (0.25 us). Prefer step(), and batches where there is more than one configuration.
#include <algorithm>
#include <tuple>
#include <utility>

#include "ctcr/mechanics/solve.hpp"
#include "ctcr/parallel/thread_pool.hpp"

namespace ctcr {
namespace detail {

/// Lane groups First .. First + Count - 1 of the columns Col.
template <class Col, int First, int Count>
struct ColumnSlice {
  static constexpr bool jacobian = Col::jacobian, loaded = Col::loaded, weight = Col::weight;
  static constexpr int groups = Count;
  static constexpr int beta = Col::beta - First * lane_count;  ///< of tube 2; may be before the slice
  static constexpr int first_beta_group = std::clamp(Col::first_beta_group - First, 0, Count);
  static constexpr int starts_with(int g) noexcept { return Col::starts_with(First + g); }
};

/// The integration of one slice: all values, and the tangents of its columns.
template <int N, class Col, int First, int Count>
struct alignas(64) SlicePass {
  using Whole = Dual<Col::groups>;
  using S = Dual<Count>;
  RobotState<S, N> state;
  Frame<S> frame;
  TubeTips<N> tips;
  SegmentTubes<N> tubes;

  template <class Stepper>
  void integrate(const Coefficients<N>& c, const Joints<N>& q, int steps, const RobotState<Whole, N>& tip) noexcept {
    each(state, tip, [](S& part, const Whole& whole) {
      part.v = whole.v;
      for (int g = 0; g < Count; ++g) part.d[g] = whole.d[First + g];
    });
    tubes = detail::integrate<Stepper, ColumnSlice<Col, First, Count>>(c, q, steps, state, frame, tips);
  }

  /// Puts the columns of this slice into those of all.
  void merge_into(RobotState<Whole, N>& all, Frame<Whole>& all_frame) const noexcept {
    each(state, all, [](const S& part, Whole& whole) {
      whole.v = part.v;
      for (int g = 0; g < Count; ++g) whole.d[First + g] = part.d[g];
    });
    static_cast<Frame<double>&>(all_frame) = frame;
    for (int i = 0; i < 3; ++i)
      for (int g = 0; g < Count; ++g) {
        all_frame.rotation_twist[i][First + g] = frame.rotation_twist[i][g];
        if constexpr (Col::jacobian) all_frame.translation_twist[i][First + g] = frame.translation_twist[i][g];
      }
  }

private:
  template <class A, class B, class F>
  static void each(A& a, B& b, const F& f) noexcept {
    for (std::size_t i = 0; i < N; ++i) f(a.psi[i], b.psi[i]), f(a.w[i], b.w[i]);
    if constexpr (Col::loaded) {
      for (std::size_t i = 0; i < 2; ++i) f(a.m[i], b.m[i]);
      for (std::size_t i = 0; i < 3; ++i) f(a.n[i], b.n[i]);
    }
    if constexpr (Col::weight)
      for (std::size_t i = 0; i < 3; ++i) f(a.g[i], b.g[i]);
  }
};

/// evaluate() with the lane groups shared among at most `Slices` threads of the pool.
template <Derivatives D, Loading L, class Stepper, int Slices, int N>
void evaluate_split(const Coefficients<N>& c, const Joints<N>& q, const TipLoad& load, const TipGuess<N>& guess,
                    int steps, ThreadPool& pool, Evaluation<N, L, D>& out) noexcept {
  using Col = Columns<N, L, D>;
  if constexpr (Slices <= 1) {
    evaluate<D, L, Stepper>(c, q, load, guess, steps, out);
  } else if (pool.size() < Slices) {
    evaluate_split<D, L, Stepper, Slices - 1>(c, q, load, guess, steps, pool, out);
  } else {
    using S = Dual<Col::groups>;
    turn_axes<L>(load, out.axis);
    RobotState<S, N> state = tip_state<Col, S>(c, load, guess, out.axis);
    Frame<S> frame;
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      constexpr int groups = lane_groups(Col::newton);  // the residual is not integrated
      constexpr auto first = [](std::size_t slice) { return int(slice) * groups / Slices; };
      std::tuple<SlicePass<N, Col, first(I), first(I + 1) - first(I)>...> slices;
      pool.parallel_for(Slices, [&](int slice, int) noexcept {
        ((slice == int(I) ? std::get<I>(slices).template integrate<Stepper>(c, q, steps, state) : void()), ...);
      });
      (std::get<I>(slices).merge_into(state, frame), ...);
      out.tips = std::get<0>(slices).tips;
      assemble<D, L, Stepper>(c, q, load, guess, state, frame, std::get<0>(slices).tubes, out);
    }(std::make_index_sequence<std::size_t(Slices)>{});
  }
}

}  // namespace detail

/// step() with the columns of its evaluation shared among the threads of a pool: each computes all values anew, and the
/// tangents of its own columns, four at a time. The answer is that of step() to rounding. The caller works alone where
/// the columns fit into one group of lanes (up to 3 tubes unloaded, or without the Jacobian) and at a cold start.
/// Real time: as step() and ThreadPool::parallel_for.
template <Derivatives D = Derivatives::jacobian, class Stepper = MagnusRk4, int N>
Status split_step(const Model<N>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws, Solution<N>& out,
                  ThreadPool& pool, const Settings& settings = {}) noexcept {
  return detail::dispatch<D, Stepper>(model, q, load, out, [&](auto loading) noexcept {
    constexpr Loading L = decltype(loading)::value;
    constexpr int groups = lane_groups(Columns<N, L, D>::newton);
    const auto evaluate_at = [&](const TipGuess<N>& guess, Evaluation<N, L, D>& ev) noexcept {
      detail::evaluate_split<D, L, Stepper, groups>(model.coefficients(), q, load, guess, settings.steps, pool, ev);
    };
    return detail::step_as<D, L, Stepper>(model, q, load, ws, out, settings, evaluate_at);
  });
}

}  // namespace ctcr
