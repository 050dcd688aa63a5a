#pragma once
// The whole model once more, built with the portable form of Lanes, behind plain numbers: scalar.cpp cannot share a
// translation unit, or even a namespace, with the vector form.
namespace ctcr_scalar_build {

inline constexpr int result_size = 1 + 3 + 9 + 36 + 36 + 1;

/// Three tubes of the paper's robot. joints: beta_1..3, alpha_1..3; load: force, moment.
/// result: status, position, rotation, J (6 x 6), C (6 x 6), stability.
void solve_paper_robot(const double (&joints)[6], const double (&load)[6], const double (&gravity)[3],
                       bool with_compliance, double (&result)[result_size]);

}  // namespace ctcr_scalar_build
