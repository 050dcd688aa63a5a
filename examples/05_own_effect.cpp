// An effect of one's own: a struct in the user's program, beside those of the library, with exact derivatives.
#include <cstdio>
#include <ctcr/ctcr.hpp>
#include <ctcr/effects/softening.hpp>
#include <ctcr/recording/derivatives.hpp>

namespace pickup {

inline constexpr ctcr::EffectInfo info{
    .id = "rotation_pickup",
    .title = "Rotation picked up with translation",
    .physics = "The carriage twists a tube a little while it pushes it.",
    .signature = "The error grows with how far a tube is pushed in, and turns with the tube.",
    .measure = "Push one tube in small steps without turning any.",
    .look_alikes = "delay",
    .reference = "",
};
inline constexpr std::array parameters{
    ctcr::EffectParameter{.name = "gain",
                          .unit = "rad/m",
                          .sigma = 1,
                          .hard = {-5, 5},
                          .per_tube = true,
                          .meaning = "turn per insertion"},
};

/// The contract is in ctcr/effects/hooks.hpp: one hook here, `actuate`. P is double, or a number that carries slopes.
template <int N, class P = double>
struct Effect : ctcr::EffectValues<parameters, N, P> {
  static constexpr const ctcr::EffectInfo& info = pickup::info;

  void actuate(const ctcr::Occasion&, std::array<P, N>& beta, std::array<P, N>& alpha) const noexcept {
    for (std::size_t i = 0; i < N; ++i) alpha[i] = alpha[i] + this->template get<0>(int(i)) * beta[i];
  }
};

}  // namespace pickup

int main() {
  constexpr int N = 2;
  using Effects = ctcr::EffectList<ctcr::Softening, pickup::Effect>;
  using Parameters = ctcr::SystemParameters<N, Effects>;

  ctcr::Robot<N> robot;
  robot.tubes[0] = {.youngs_modulus = 58e9,
                    .inner_diameter = 1.30e-3,
                    .outer_diameter = 1.52e-3,
                    .length = 0.40,
                    .curved_length = 0.05,
                    .curvature = 10};
  robot.tubes[1] = {.youngs_modulus = 58e9,
                    .inner_diameter = 1.62e-3,
                    .outer_diameter = 1.80e-3,
                    .length = 0.25,
                    .curved_length = 0.05,
                    .curvature = 5};
  Effects::On<N> effects;                                         // neutral: changes nothing
  std::get<pickup::Effect<N>>(effects.list).values = {0.5, 0.0};  // tube 1: half a radian per metre
  const ctcr::System<N, Effects> system{{}, ctcr::Model<N, Effects>(robot, effects), {}};

  const ctcr::RecordedRow<N> row{
      .theta = {.translation = {-0.28, -0.18}, .rotation = {0.0, 1.0}}, .load = {}, .at = {}};
  const auto read = [&](const auto& of, ctcr::Workspace<N>& workspace, auto& prediction) {
    return ctcr::predict<N, Effects>(of, row, {}, workspace, prediction) == ctcr::Status::ok;
  };
  ctcr::Workspace<N> workspace;
  ctcr::RecordedPrediction<N, Effects> here{{}, {}, system.model};
  if (!read(system, workspace, here)) return 1;
  const ctcr::Vec3 p = here.reading.position;
  std::printf("the tip is at %.2f, %.2f, %.2f mm\n", 1e3 * p.x(), 1e3 * p.y(), 1e3 * p.z());

  // Exact derivatives by the parameters of all effects, beside central differences.
  int wrong = 0;
  for (int k = Parameters::Robot::count; k < Parameters::count; ++k) {
    Eigen::Matrix<double, 6, 1> slope;
    const int places[] = {k};
    if (ctcr::differentiate<N, Effects>(system, row, workspace, here, places, slope) != ctcr::Status::ok) return 1;
    const Eigen::VectorXd values = Parameters::values(system);
    const double step = 1e-6;
    ctcr::Vec3 moved[2];
    for (int side = 0; side < 2; ++side) {
      Eigen::VectorXd x = values;
      x[k] += side ? step : -step;
      ctcr::Workspace<N> fresh;
      ctcr::RecordedPrediction<N, Effects> there{{}, {}, system.model};
      if (!read(Parameters::with_values(system, x), fresh, there)) return 1;
      moved[side] = there.reading.position;
    }
    const ctcr::Vec3 difference = (moved[1] - moved[0]) / (2 * step);
    std::printf("%-36s %9.5f %9.5f %9.5f   off by %.0e\n", Parameters::name(k).c_str(), slope[0], slope[1], slope[2],
                (slope.head<3>() - difference).norm());
    wrong += (slope.head<3>() - difference).norm() > 1e-6 * (1 + difference.norm());
  }
  return wrong;
}

// Prints:
//   the tip is at 7.31, -17.91, 116.48 mm
//   effects.softening.gamma.1              0.03189  -0.02048  -0.00773   off by 6e-12
//   effects.softening.gamma.2             -0.01507   0.00968   0.00366   off by 8e-12
//   effects.rotation_pickup.gain.1        -0.00337   0.00046   0.00046   off by 8e-12
//   effects.rotation_pickup.gain.2        -0.00106  -0.00161  -0.00030   off by 8e-12
