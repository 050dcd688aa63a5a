#pragma once
// A robot with joints and load as text to paste, and back.
#include <cstdio>
#include <istream>
#include <sstream>
#include <string>

#include "support/laws.hpp"

namespace ctcr::test {

/// Gravity [m/s^2], a line for each tube from the innermost on (SI), and the load at the tip [N], [N m].
template <int N>
std::string text(const Case<N>& c) {
  char line[512];
  const auto vector = [&](const char* name, const Vec3& v) {
    std::snprintf(line, sizeof line, " %s %.17g %.17g %.17g", name, v[0], v[1], v[2]);
    return std::string(line);
  };
  std::string all = vector("grav", c.robot.gravity) + "\n";
  for (int i = 0; i < N; ++i) {
    const Tube& t = c.robot.tubes[std::size_t(i)];
    std::snprintf(line, sizeof line,
                  " tube E=%.17g nu=%.17g rho=%.17g id=%.17g od=%.17g l=%.17g lc=%.17g k=%.17g beta=%.17g alpha=%.17g",
                  t.youngs_modulus, t.poisson_ratio, t.density, t.inner_diameter, t.outer_diameter, t.length,
                  t.curved_length, t.curvature, c.q.beta[i], c.q.alpha[i]);
    all += line;
    if (t.bending_stiffness != 0) all += " EI=" + std::to_string(t.bending_stiffness);
    all += "\n";
  }
  return all + vector("force", c.load.force) + vector(" moment", c.load.moment) + "\n";
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
    Tube& t = c.robot.tubes[std::size_t(i)];
    in >> word;
    for (double* x : {&t.youngs_modulus, &t.poisson_ratio, &t.density, &t.inner_diameter, &t.outer_diameter, &t.length,
                      &t.curved_length, &t.curvature, &c.q.beta[i], &c.q.alpha[i]})
      number(*x);
  }
  vector(c.load.force);
  vector(c.load.moment);
  return bool(in);
}

}  // namespace ctcr::test
