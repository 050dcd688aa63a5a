// The oracle's energy once more, general and fast: minimises the discrete elastic energy of one configuration.
//
// Unknowns x: the rotation w_e = (wx, wy) of each element in the torsion-free frame, then theta_i at each node of each
// tube. An element of length h > 0 bends: w = h u. An element of length 0 is a joint: a gap, a spring, an arm.
//
//     E = sum_e h sum_i psi_i(v_i) + sum_i sum_e GJ_i (dtheta_i - h tau_i)^2 / (2 h) + sum_i base_i(theta_i,0 - alpha_i)
//       + sum_joints gap(|w|) + sum_contacts huber(slip) - sum_j W_j . p_j + sum_j hertz(depth of p_j in obstacles)
//
// with v_i = Rz(-theta_i) u - u*_i at the middle of the element. Nothing here is shared with the library.

#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernel_turn.hpp"

extern "C" {

struct Problem {
  int elements, tubes, table_size, contacts, obstacles;
  double table_step;           // [1/m] of the tables of tangent stiffness
  const double* h;             // (M) [m]; 0 for a joint
  const int* tip;              // (N) node at the tip of tube i, 0 when not deployed
  const double* stiffness;     // (N, 3) xx, xy, yy of the section [N m^2]
  const double* torsion;       // (N) [N m^2]
  const double* precurvature;  // (N, M, 3) [1/m]
  const double* tangent;       // (N, table_size) tangent over initial stiffness against |v|, or null: linear
  const double* base;          // (N, 3) alpha [rad], stiffness [N m/rad], cubic stiffness [N m/rad^3]
  const double* joint;      // (M, 4) contact stiffness, centring stiffness [N m/rad], gap [rad], arm [m] of the first
  const double* force;      // (M+1, 3) dead load at the nodes [N]
  const int* contact_node;  // (C, 2) unknowns
  const double* contact;    // (C, 5) torque limit [N m], stiffness, anchor (2), slip [rad]
  const double* plastic;    // (N, 2) stiffness [N m^2] and moment limit [N m] of the yielding branch
  const double* plastic_anchor;  // (N, M, 2) [1/m], or null
  const double* obstacle;        // (O, 5) centre (3), radius [m], Hertz stiffness [N/m^1.5 per m of tube]
};
}

namespace oracle {

struct Law {  // energy density, moment (2) and tangent (xx, xy, yy) of a section bent by v
  double value, gx, gy, xx, xy, yy;
};

// Stored and dissipated energy of one small move of an elastic-plastic joint, the dissipation minimised out.
struct Huber {
  double value, secant, xx, xy, yy;
};

inline Huber huber(double x, double y, double k, double limit) {
  const double norm = std::hypot(x, y);
  if (k * norm <= limit) return {0.5 * k * norm * norm, k, k, 0, k};
  const double secant = limit / norm, nx = x / norm, ny = y / norm;
  return {limit * norm - 0.5 * limit * limit / k, secant, secant * (1 - nx * nx), -secant * nx * ny,
          secant * (1 - ny * ny)};
}

class Energy {
public:
  explicit Energy(const Problem& problem)
    : p_(problem),
      offset_(problem.tubes),
      rotation_(problem.elements + 1),
      position_(problem.elements + 1),
      turn_(2 * problem.elements),
      shift_(2 * problem.elements) {
    int next = 2 * p_.elements;
    for (int i = 0; i < p_.tubes; ++i) {
      offset_[i] = next;
      next += p_.tip[i] + 1;
    }
    size_ = next;
    for (int j = 0; j <= p_.elements && !loaded_; ++j) loaded_ = length2(load(j)) > 0;
    loaded_ = loaded_ || p_.obstacles > 0;
  }

  int size() const { return size_; }
  const Mat& rotation(int j) const { return rotation_[j]; }
  Vec position(int j) const { return position_[j]; }
  int offset(int tube) const { return offset_[tube]; }

  void make_backbone(const Vector& x) {
    rotation_[0] = Mat{};
    position_[0] = {0, 0, p_.elements > 0 && p_.h[0] == 0 ? -p_.joint[3] : 0.0};  // pivot of a joint at the entry
    for (int e = 0; e < p_.elements; ++e) {
      const Turn turn = make_turn(x[2 * e], x[2 * e + 1]);
      const Mat& start = rotation_[e];
      turn_[2 * e] = start * turn.jacobian_x;
      turn_[2 * e + 1] = start * turn.jacobian_y;
      rotation_[e + 1] = start * turn.rotation;
      Vec step;
      if (p_.h[e] > 0) {
        step = p_.h[e] * (start * turn.chord);
        shift_[2 * e] = p_.h[e] * (start * turn.chord_x);
        shift_[2 * e + 1] = p_.h[e] * (start * turn.chord_y);
      } else {
        step = (e == 0 ? p_.joint[4 * e + 3] : 0.0) * rotation_[e + 1].c;
        shift_[2 * e] = cross(turn_[2 * e], step);
        shift_[2 * e + 1] = cross(turn_[2 * e + 1], step);
      }
      position_[e + 1] = position_[e] + step;
    }
  }

  Law law(const Vector& x, int i, int e, double& c, double& s, double& qx, double& qy) const {
    const double* theta = &x[offset_[i] + e];
    const double middle = 0.5 * (theta[0] + theta[1]);
    c = std::cos(middle), s = std::sin(middle);
    const double ux = x[2 * e] / p_.h[e], uy = x[2 * e + 1] / p_.h[e];
    qx = c * ux + s * uy, qy = -s * ux + c * uy;
    const double* own = p_.precurvature + 3 * (i * p_.elements + e);
    const double vx = qx - own[0], vy = qy - own[1];
    const double* k = p_.stiffness + 3 * i;
    Law law;
    if (!p_.tangent) {
      law = {0, k[0] * vx + k[1] * vy, k[1] * vx + k[2] * vy, k[0], k[1], k[2]};
      law.value = 0.5 * (law.gx * vx + law.gy * vy);
    } else {
      law = nonlinear(p_.tangent + i * p_.table_size, 0.5 * (k[0] + k[2]), vx, vy);
    }
    if (p_.plastic_anchor) {
      const double* anchor = p_.plastic_anchor + 2 * (i * p_.elements + e);
      const double ax = vx - anchor[0], ay = vy - anchor[1];
      const Huber branch = huber(ax, ay, p_.plastic[2 * i], p_.plastic[2 * i + 1]);
      law.value += branch.value;
      law.gx += branch.secant * ax, law.gy += branch.secant * ay;
      law.xx += branch.xx, law.xy += branch.xy, law.yy += branch.yy;
    }
    return law;
  }

  double value(const Vector& x) { return evaluate(x, nullptr, nullptr); }

  double evaluate(const Vector& x, Vector* gradient, Vector* hessian) {
    double energy = 0;
    if (gradient) std::fill(gradient->begin(), gradient->end(), 0.0);
    if (hessian) std::fill(hessian->begin(), hessian->end(), 0.0);
    for (int i = 0; i < p_.tubes; ++i) energy += tube(x, i, gradient, hessian);
    for (int e = 0; e < p_.elements; ++e)
      if (p_.h[e] == 0) energy += joint(x, e, gradient, hessian);
    for (int n = 0; n < p_.contacts; ++n) energy += contact(x, n, gradient, hessian);
    if (loaded_) energy += loads(x, gradient, hessian);
    return energy;
  }

private:
  static double length2(Vec v) { return dot(v, v); }
  Vec load(int j) const { return {p_.force[3 * j], p_.force[3 * j + 1], p_.force[3 * j + 2]}; }

  Law nonlinear(const double* ratio, double k, double vx, double vy) const {
    const double step = p_.table_step, r = std::hypot(vx, vy);
    double moment = 0, value = 0;
    const int last = p_.table_size - 1;
    const int cell = std::min(static_cast<int>(r / step), last);
    for (int n = 0; n < cell; ++n) {
      value += step * moment + k * step * step * (ratio[n] / 3 + ratio[n + 1] / 6);
      moment += 0.5 * k * step * (ratio[n] + ratio[n + 1]);
    }
    const double t = r - cell * step, slope = cell < last ? (ratio[cell + 1] - ratio[cell]) / step : 0.0;
    value += t * moment + k * t * t * (ratio[cell] / 2 + slope * t / 6);
    moment += k * t * (ratio[cell] + 0.5 * slope * t);
    const double tangent = k * (ratio[cell] + slope * t);
    const double secant = r > 1e-9 ? moment / r : k * ratio[0], extra = tangent - secant;
    const double nx = r > 1e-9 ? vx / r : 0, ny = r > 1e-9 ? vy / r : 0;
    return {value, secant * vx, secant * vy, secant + extra * nx * nx, extra * nx * ny, secant + extra * ny * ny};
  }

  void add(Vector& hessian, int row, int column, double value) const {
    hessian[static_cast<std::size_t>(row) * size_ + column] += value;
    if (row != column) hessian[static_cast<std::size_t>(column) * size_ + row] += value;
  }

  double tube(const Vector& x, int i, Vector* gradient, Vector* hessian) const {
    const double* base = p_.base + 3 * i;
    const int first = offset_[i];
    const double twist = x[first] - base[0];
    double energy = 0.5 * base[1] * twist * twist + 0.25 * base[2] * twist * twist * twist * twist;
    if (gradient) (*gradient)[first] += base[1] * twist + base[2] * twist * twist * twist;
    if (hessian) add(*hessian, first, first, base[1] + 3 * base[2] * twist * twist);
    for (int e = 0; e < p_.tip[i]; ++e) {
      const double length = std::max(p_.h[e], 1e-6);  // a joint does not twist
      const double spring = p_.torsion[i] / length;
      const double rate = p_.precurvature[3 * (i * p_.elements + e) + 2];
      const double turn = x[first + e + 1] - x[first + e] - p_.h[e] * rate;
      energy += 0.5 * spring * turn * turn;
      if (gradient) {
        (*gradient)[first + e] -= spring * turn;
        (*gradient)[first + e + 1] += spring * turn;
      }
      if (hessian) {
        add(*hessian, first + e, first + e, spring);
        add(*hessian, first + e + 1, first + e + 1, spring);
        add(*hessian, first + e, first + e + 1, -spring);
      }
      if (p_.h[e] == 0) continue;
      double c, s, qx, qy;
      const Law section = law(x, i, e, c, s, qx, qy);
      energy += p_.h[e] * section.value;
      if (!gradient) continue;
      const double gx = section.gx, gy = section.gy, h = p_.h[e];
      (*gradient)[2 * e] += c * gx - s * gy;
      (*gradient)[2 * e + 1] += s * gx + c * gy;
      const double of_angle = h * (gx * qy - gy * qx);
      (*gradient)[first + e] += 0.5 * of_angle;
      (*gradient)[first + e + 1] += 0.5 * of_angle;
      if (!hessian) continue;
      const double ax = section.xx * c - section.xy * s, ay = section.xy * c - section.yy * s;  // tangent Q^T e1
      const double bx = section.xx * s + section.xy * c, by = section.xy * s + section.yy * c;  // tangent Q^T e2
      add(*hessian, 2 * e, 2 * e, (c * ax - s * ay) / h);
      add(*hessian, 2 * e, 2 * e + 1, (c * bx - s * by) / h);
      add(*hessian, 2 * e + 1, 2 * e + 1, (s * bx + c * by) / h);
      const double dx = section.xx * qy - section.xy * qx, dy = section.xy * qy - section.yy * qx;
      const double mixed[2] = {c * dx - s * dy - s * gx - c * gy, s * dx + c * dy + c * gx - s * gy};
      for (int axis = 0; axis < 2; ++axis)
        for (int node = 0; node < 2; ++node) add(*hessian, 2 * e + axis, first + e + node, 0.5 * mixed[axis]);
      const double angle = 0.25 * h * (qy * dx - qx * dy - gx * qx - gy * qy);
      add(*hessian, first + e, first + e, angle);
      add(*hessian, first + e + 1, first + e + 1, angle);
      add(*hessian, first + e, first + e + 1, angle);
    }
    return energy;
  }

  double joint(const Vector& x, int e, Vector* gradient, Vector* hessian) const {
    const double wx = x[2 * e], wy = x[2 * e + 1], r = std::hypot(wx, wy);
    const double stiff = p_.joint[4 * e], soft = p_.joint[4 * e + 1], gap = p_.joint[4 * e + 2];
    // Beyond the gap the stiffness rises over a tenth of it, so that Newton's method sees no kink.
    const double beyond = std::max(r - gap, 0.0), rise = 0.1 * gap;
    const bool rising = beyond < rise;
    const double energy =
        rising ? beyond * beyond * beyond / (6 * rise) : 0.5 * beyond * (beyond - rise) + rise * rise / 6;
    const double torque = rising ? beyond * beyond / (2 * rise) : beyond - 0.5 * rise;
    const double tangent = rising ? beyond / rise : 1.0;
    const double secant = soft + stiff * (r > 0 ? torque / r : tangent);
    if (gradient) {
      (*gradient)[2 * e] += secant * wx;
      (*gradient)[2 * e + 1] += secant * wy;
    }
    if (hessian) {
      const double extra = r > 0 ? (soft + stiff * tangent - secant) / (r * r) : 0;
      add(*hessian, 2 * e, 2 * e, secant + extra * wx * wx);
      add(*hessian, 2 * e, 2 * e + 1, extra * wx * wy);
      add(*hessian, 2 * e + 1, 2 * e + 1, secant + extra * wy * wy);
    }
    return 0.5 * soft * r * r + stiff * energy;
  }

  double contact(const Vector& x, int n, Vector* gradient, Vector* hessian) const {
    const int a = p_.contact_node[2 * n], b = p_.contact_node[2 * n + 1];
    const double* c = p_.contact + 5 * n;
    const double turn = x[a] - x[b] - c[2];
    const Huber branch = huber(turn, c[4] - c[3], c[1], c[0]);
    if (gradient) {
      (*gradient)[a] += branch.secant * turn;
      (*gradient)[b] -= branch.secant * turn;
    }
    if (hessian) {
      add(*hessian, a, a, branch.xx);
      add(*hessian, b, b, branch.xx);
      add(*hessian, a, b, -branch.xx);
    }
    return branch.value;
  }

  double loads(const Vector& x, Vector* gradient, Vector* hessian) {
    make_backbone(x);
    const int nodes = p_.elements + 1;
    std::vector<Vec> force(nodes);
    double energy = 0;
    for (int j = 0; j < nodes; ++j) {
      force[j] = load(j);
      energy -= dot(force[j], position_[j]);
    }
    for (int j = 1; j < nodes; ++j)
      for (int o = 0; o < p_.obstacles; ++o) energy += obstacle(j, o, force[j], gradient ? hessian : nullptr);
    if (!gradient) return energy;
    // Beyond element e: carried force, moment about node e+1, and sum of lever x force as a dyad.
    Vec carried, dyad_x, dyad_y, dyad_z;  // dyad_a = sum over nodes beyond of force.a * lever
    Vec from = position_[nodes - 1];
    for (int e = p_.elements - 1; e >= 0; --e) {
      const Vec move = from - position_[e + 1];
      dyad_x = dyad_x + carried.x * move;
      dyad_y = dyad_y + carried.y * move;
      dyad_z = dyad_z + carried.z * move;
      carried = carried + force[e + 1];
      from = position_[e + 1];
      const Vec moment{dyad_z.y - dyad_y.z, dyad_x.z - dyad_z.x, dyad_y.x - dyad_x.y};
      const double trace = dyad_x.x + dyad_y.y + dyad_z.z;
      for (int axis = 0; axis < 2; ++axis) {
        const int f = 2 * e + axis;
        (*gradient)[f] -= dot(shift_[f], carried) + dot(turn_[f], moment);
        if (!hessian) continue;
        // work of the loads when an element before f turns by r: r . (shift x F + sum (turn x lever) x force)
        const Vec t = turn_[f];
        const Vec lever = cross(shift_[f], carried) + t.x * dyad_x + t.y * dyad_y + t.z * dyad_z - trace * t;
        for (int g = 0; g < 2 * e; ++g) add(*hessian, g, f, -dot(turn_[g], lever));
        add(*hessian, f, f, -dot(t, lever));
        add(*hessian, 2 * e, 2 * e + 1, -0.5 * dot(turn_[axis == 0 ? f + 1 : f - 1], lever));
      }
    }
    return energy;
  }

  double obstacle(int j, int o, Vec& force, Vector* hessian) const {
    const double* data = p_.obstacle + 5 * o;
    const Vec away = position_[j] - Vec{data[0], data[1], data[2]};
    const double distance = std::sqrt(length2(away)), depth = data[3] - distance;
    if (depth <= 0) return 0;
    const double reach = 0.5 * (p_.h[j - 1] + (j < p_.elements ? p_.h[j] : 0.0));
    const double k = data[4] * reach, push = k * std::pow(depth, 1.5);
    const Vec n = (1 / distance) * away;
    force = force + push * n;
    if (hessian) {
      Vector slope(2 * j);
      for (int f = 0; f < 2 * j; ++f)
        slope[f] = dot(n, shift_[f] + cross(turn_[f], position_[j] - position_[f / 2 + 1]));
      const double stiff = 1.5 * k * std::sqrt(depth);
      for (int f = 0; f < 2 * j; ++f)
        for (int g = 0; g <= f; ++g) add(*hessian, g, f, stiff * slope[f] * slope[g]);
    }
    return k * std::pow(depth, 2.5) / 2.5;
  }

  const Problem& p_;
  std::vector<int> offset_;
  std::vector<Mat> rotation_;
  std::vector<Vec> position_, turn_, shift_;
  int size_ = 0;
  bool loaded_ = false;
};

}  // namespace oracle
