// What kernel.py calls: Newton's method on the energy of one configuration, and what the solution looks like.

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernel_energy.hpp"

namespace {

using namespace oracle;

// Upper Cholesky factor in place, row by row; false when not positive definite.
bool factorise(Vector& m, int n) {
  for (int k = 0; k < n; ++k) {
    double* row = &m[static_cast<std::size_t>(k) * n];
    if (!(row[k] > 0)) return false;
    const double inverse = 1 / std::sqrt(row[k]);
    for (int j = k; j < n; ++j) row[j] *= inverse;
    for (int i = k + 1; i < n; ++i) {
      const double factor = row[i];
      if (factor == 0) continue;
      double* other = &m[static_cast<std::size_t>(i) * n];
      for (int j = i; j < n; ++j) other[j] -= factor * row[j];
    }
  }
  return true;
}

// Upper triangle with the angles before the bends: angles are chained to their neighbours only, so most stays zero.
void angles_first(const Vector& hessian, int n, int bends, Vector& result) {
  for (int i = 0; i < n; ++i) {
    const double* row = &hessian[static_cast<std::size_t>(i < n - bends ? i + bends : i + bends - n) * n];
    double* out = &result[static_cast<std::size_t>(i) * n];
    std::copy(row + bends, row + n, out);
    std::copy(row, row + bends, out + n - bends);
  }
}

void solve(const Vector& m, int n, Vector& x) {
  for (int k = 0; k < n; ++k) {
    const double* row = &m[static_cast<std::size_t>(k) * n];
    x[k] /= row[k];
    for (int j = k + 1; j < n; ++j) x[j] -= row[j] * x[k];
  }
  for (int k = n - 1; k >= 0; --k) {
    const double* row = &m[static_cast<std::size_t>(k) * n];
    double sum = x[k];
    for (int j = k + 1; j < n; ++j) sum -= row[j] * x[j];
    x[k] = sum / row[k];
  }
}

double step_size(const Problem& p, const Vector& step) {
  double largest = 1e-300;
  for (int k = 0; k < static_cast<int>(step.size()); ++k) {
    const bool bends = k < 2 * p.elements && p.h[k / 2] > 0;
    largest = std::max(largest, std::abs(step[k]) * (bends ? 0.1 / p.h[k / 2] : 1.0));
  }
  return largest;
}

}  // namespace

extern "C" {

// Number of Newton steps to the minimum near x (size unknowns, changed in place), or -1 when there is none.
int oracle_minimise(const Problem* problem, double* unknowns, double converged, int most) {
  Energy energy(*problem);
  const int n = energy.size(), bends = 2 * problem->elements;
  Vector x(unknowns, unknowns + n), gradient(n), hessian(static_cast<std::size_t>(n) * n), factor(hessian), step, trial;
  // What resists the twist of a millimetre: short elements and joints must not stop a shifted step.
  const double stiffest = 1e3 * *std::max_element(problem->torsion, problem->torsion + problem->tubes);
  double value = 0;
  for (int iteration = 1; iteration <= most; ++iteration) {
    value = energy.evaluate(x, &gradient, &hessian);
    double shift = 0;
    for (;;) {
      angles_first(hessian, n, bends, factor);
      for (int k = 0; k < n && shift > 0; ++k) {
        double& diagonal = factor[static_cast<std::size_t>(k) * n + k];
        diagonal += shift * (k < n - bends ? std::min(std::abs(diagonal), stiffest) : std::abs(diagonal));
      }
      if (factorise(factor, n)) break;
      shift = std::max(4 * shift, 1e-3);
      if (shift > 1e6) return -1;
    }
    step = gradient;
    std::rotate(step.begin(), step.begin() + bends, step.end());
    solve(factor, n, step);
    std::rotate(step.begin(), step.end() - bends, step.end());
    for (double& s : step) s = -s;
    const double size = step_size(*problem, step);
    if (!std::isfinite(size)) return -1;
    double scale = std::min(1.0, 1.0 / size), slope = 0;
    if (size < converged && shift == 0) {
      for (int k = 0; k < n; ++k) unknowns[k] = x[k] + step[k];
      return iteration;
    }
    for (int k = 0; k < n; ++k) slope += gradient[k] * step[k];
    for (;;) {
      trial = x;
      for (int k = 0; k < n; ++k) trial[k] += scale * step[k];
      if (energy.value(trial) <= value + 1e-4 * scale * slope + 1e-15 * std::abs(value) || scale * size < converged)
        break;
      scale *= 0.5;
    }
    x = trial;
  }
  return -1;
}

// Energy and its gradient (size) and Hessian (size, size) at x; for tests.
double oracle_energy(const Problem* problem, const double* x, double* gradient, double* hessian) {
  Energy energy(*problem);
  const std::size_t n = energy.size();
  Vector g(n), h(n * n);
  const double value = energy.evaluate(Vector(x, x + n), &g, &h);
  std::copy(g.begin(), g.end(), gradient);
  std::copy(h.begin(), h.end(), hessian);
  return value;
}

// Frames of the M+1 nodes: positions (M+1, 3) and rotations (M+1, 3, 3) of the torsion-free frame.
void oracle_frames(const Problem* problem, const double* x, double* position, double* rotation) {
  Energy energy(*problem);
  energy.make_backbone(Vector(x, x + energy.size()));
  for (int j = 0; j <= problem->elements; ++j) {
    const Vec p = energy.position(j);
    const Mat& r = energy.rotation(j);
    const double entries[9] = {r.a.x, r.b.x, r.c.x, r.a.y, r.b.y, r.c.y, r.a.z, r.b.z, r.c.z};
    std::copy(entries, entries + 9, rotation + 9 * j);
    position[3 * j] = p.x, position[3 * j + 1] = p.y, position[3 * j + 2] = p.z;
  }
}

// Of every tube and element: bending moment (N, M, 2) in the torsion-free frame and deviation v (N, M, 2) in its own.
void oracle_sections(const Problem* problem, const double* x, double* moment, double* deviation) {
  const Energy energy(*problem);
  const Vector unknowns(x, x + energy.size());
  for (int i = 0; i < problem->tubes; ++i)
    for (int e = 0; e < problem->tip[i]; ++e) {
      if (problem->h[e] == 0) continue;
      const int at = i * problem->elements + e;
      double c, s, qx, qy;
      const Law law = energy.law(unknowns, i, e, c, s, qx, qy);
      moment[2 * at] = c * law.gx - s * law.gy;
      moment[2 * at + 1] = s * law.gx + c * law.gy;
      deviation[2 * at] = qx - problem->precurvature[3 * at];
      deviation[2 * at + 1] = qy - problem->precurvature[3 * at + 1];
    }
}
}
