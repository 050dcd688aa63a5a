#pragma once
// A robot with joints and load as text to paste, and back.
#include <array>
#include <cstdlib>
#include <iomanip>
#include <istream>
#include <sstream>
#include <string>
#include <utility>

#include "support/laws.hpp"

namespace ctcr::test {

/// Names and numbers of a tube and its joints, as they stand in a line.
template <int N>
auto fields(Case<N>& c, int tube) {
  Tube& t = c.robot.tubes[std::size_t(tube)];
  return std::array<std::pair<const char*, double*>, 11>{{{"E", &t.youngs_modulus},
                                                          {"nu", &t.poisson_ratio},
                                                          {"rho", &t.density},
                                                          {"id", &t.inner_diameter},
                                                          {"od", &t.outer_diameter},
                                                          {"l", &t.length},
                                                          {"lc", &t.curved_length},
                                                          {"k", &t.curvature},
                                                          {"beta", &c.q.beta[tube]},
                                                          {"alpha", &c.q.alpha[tube]},
                                                          {"EI", &t.bending_stiffness}}};
}

/// Gravity [m/s^2], a line for each tube from the innermost on (SI), and the load at the tip [N], [N m].
template <int N>
std::string text(Case<N> c) {
  std::ostringstream out;
  out << std::setprecision(17);
  const auto vector = [&](const char* name, const Vec3& v) {
    out << " " << name << " " << v[0] << " " << v[1] << " " << v[2];
  };
  vector("grav", c.robot.gravity);
  for (int i = 0; i < N; ++i) {
    out << "\n tube";
    for (const auto& [name, number] : fields(c, i)) out << " " << name << "=" << *number;
  }
  out << "\n";
  vector("force", c.load.force);
  vector("moment", c.load.moment);
  out << "\n";
  return out.str();
}

/// Reads what text() writes. @return whether it could
template <int N>
bool read(std::istream& in, Case<N>& c) {
  std::string word;
  const auto number = [&](double& x) {  // of "x" or "name=x"
    in >> word;
    x = std::strtod(word.c_str() + word.find('=') + 1, nullptr);
  };
  const auto vector = [&](Vec3& v) {
    in >> word;
    for (double& x : v) number(x);
  };
  vector(c.robot.gravity);
  for (int i = 0; i < N; ++i) {
    in >> word;
    for (const auto& field : fields(c, i)) number(*field.second);
  }
  vector(c.load.force);
  vector(c.load.moment);
  return bool(in);
}

}  // namespace ctcr::test
