#pragma once
#include <optional>

#include "ctcr/recording/path.hpp"
#include "ctcr/recording/variables.hpp"

namespace ctcr::detail {

/// The effect that follows the twist, on its way along a recording, with derivatives by a window of variables.
template <int N, class Fx, class Window>
class FollowerWay {
  using S = typename Window::S;
  using Effects = typename Fx::template On<N, S>;

public:
  using Effect = std::tuple_element_t<Effects::follower, decltype(Effects::list)>;
  using Row = typename Path<N, S>::Row;

  FollowerWay(const System<N, Fx>& system, const ContactRadii<N>& radius, const Variables<N, Fx>& variables,
              const Window& window) noexcept
    : transmission_(&system.transmission),
      radius_(radius),
      variables_(&variables),
      window_(window),
      effect_(std::get<Effects::follower>(variables.effects(system.model.effects(), window).list)) {
    effect_.history = {};
  }

  /// A place without slopes of the twist.
  [[nodiscard]] Row row(const RecordedRow<N>& here, const typename Path<N, double>::Row& plain) const noexcept {
    Row r;
    joints_of<N, S>(*transmission_, here.theta, variables_->seeding(window_), r.beta, r.alpha);
    std::ranges::copy(plain.twist, r.twist.begin());
    r.jumps = plain.jumps;
    return r;
  }

  /// The effect at the next place; the first one is where it begins.
  [[nodiscard]] Effect reached(const Row& to) const noexcept {
    Effect next = effect_;
    if (!from_) return next;
    const std::array<Row, 2> q{*from_, to};
    next.update_history({q, {}, {}, radius_}, 1);
    return next;
  }
  /// Goes there.
  void go(const Row& to) noexcept {
    effect_ = reached(to);
    from_ = to;
  }
  [[nodiscard]] const Effect& effect() const noexcept { return effect_; }

private:
  const Transmission<N>* transmission_;
  ContactRadii<N> radius_;
  const Variables<N, Fx>* variables_;
  Window window_;
  Effect effect_;
  std::optional<Row> from_;
};

}  // namespace ctcr::detail
