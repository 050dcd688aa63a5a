#pragma once
// Which directions are differentiated, and which lanes they take.
#include <cstdint>

#include "ctcr/math/lanes.hpp"

namespace ctcr {

/// Which derivatives of the tip pose a solve also returns.
enum class Derivatives : std::uint8_t {
  none,
  jacobian,    ///< J, by the joints
  compliance,  ///< J and C, by the joints and by the tip load
};

/// The load on the robot: each kind has its own, cheapest, equations.
enum class Loading {
  none,    ///< moments inside the tubes only
  force,   ///< tip force: turning the tip about it changes nothing, two unknown turns are left
  weight,  ///< tip force and moment and the tubes' own weight, any of them: three unknown turns of the tip
};

/// Lanes of the directions of differentiation, in a pass of integration and in the linear system behind it:
///
///   pass:    turns of the tip, or with compliance tip force and moment (6) | psi_2..N | beta_2..N, common (Jacobian)
///   system:  the lanes of the pass | alpha_1..N (Jacobian), residual | turns of the tip, where not above
///
/// psi are the angles of tubes 2..N at their tips, common is the shift of all beta together: only the length of the last
/// segment depends on it. The pass integrates its own lanes alone; the further ones follow at the front plate: alpha and
/// the residual from the values there, turns of the tip from the columns of force and moment. Without the Jacobian the
/// residual is the last lane of the pass, which leaves it at 0, so that it takes no group of its own.
template <int N, Loading L, Derivatives D>
struct Columns {
  static constexpr bool jacobian = D != Derivatives::none;
  static constexpr bool compliance = D == Derivatives::compliance;
  static constexpr bool loaded = L != Loading::none;
  static constexpr bool weight = L == Loading::weight;
  static_assert(loaded || !compliance, "compliance needs the loaded equations");

  static constexpr int turns = L == Loading::none ? 0 : L == Loading::force ? 2 : 3;
  static constexpr bool integrates_turns = loaded && (weight || !compliance);
  static constexpr int force = integrates_turns ? turns : 0;  ///< only with compliance
  static constexpr int moment = force + 3;
  static constexpr int psi = force + (compliance ? 6 : 0);  ///< of tube 2
  static constexpr int beta = psi + N - 1;                  ///< of tube 2; only with the Jacobian
  static constexpr int common = beta + N - 1;               ///< all beta together; only with the Jacobian
  static constexpr int groups = lane_groups(jacobian ? common + 1 : beta + 1);
  static constexpr int first_beta_group = jacobian ? beta / lane_count : groups;

  static constexpr int alpha = groups * lane_count;           ///< of tube 1; only with the Jacobian
  static constexpr int newton = jacobian ? alpha + N : beta;  ///< the residual, solved along with the others
  static constexpr int joint_groups = jacobian ? lane_groups(N + 1) : 0;
  static constexpr int turn = integrates_turns ? 0 : (groups + joint_groups) * lane_count;
  static constexpr int system_groups = groups + joint_groups + (loaded && !integrates_turns ? 1 : 0);

  static constexpr int unknowns = turns + N - 1;
  /// Lane of unknown j: turns of the tip, then psi_2..N.
  static constexpr int unknown(int j) noexcept { return j < turns ? turn + j : psi + j - turns; }

  /// Lane group g is zero from the robot tip up to the number returned: 1 the tip of tube 1, ..., N that of tube N,
  /// N + 1 the plate, N + 2 everywhere.
  static constexpr int starts_with(int g) noexcept {
    if (g * lane_count < psi) return 1;
    for (int tube = 1; tube < N; ++tube)
      if ((psi + tube - 1) / lane_count == g || (jacobian && (beta + tube - 1) / lane_count == g)) return tube + 1;
    return jacobian && common / lane_count == g ? N + 1 : N + 2;
  }
};

}  // namespace ctcr
