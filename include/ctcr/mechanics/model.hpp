#pragma once
#include "ctcr/mechanics/coefficients.hpp"

namespace ctcr {

/// A robot ready to be solved: its description and the numbers derived from it. Immutable; share it between threads.
template <int N>
class Model {
 public:
  explicit Model(const Robot<N>& robot) noexcept : robot_(robot), coefficients_(make_coefficients(robot)) {}

  [[nodiscard]] const Robot<N>& robot() const noexcept { return robot_; }
  [[nodiscard]] const Coefficients<N>& coefficients() const noexcept { return coefficients_; }

 private:
  Robot<N> robot_;
  Coefficients<N> coefficients_;
};

}  // namespace ctcr
