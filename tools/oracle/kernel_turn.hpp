// Vectors, and the rotation and chord of an element that bends evenly.

#pragma once

#include <vector>

namespace oracle {

using Vector = std::vector<double>;

struct Vec {
  double x = 0, y = 0, z = 0;
};
inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

struct Mat {  // columns
  Vec a{1, 0, 0}, b{0, 1, 0}, c{0, 0, 1};
};
inline Vec operator*(const Mat& m, Vec v) { return v.x * m.a + v.y * m.b + v.z * m.c; }
inline Mat operator*(const Mat& m, const Mat& n) { return {m * n.a, m * n.b, m * n.c}; }

// exp(w^) for w = (wx, wy, 0), the left Jacobian's columns for wx and wy, and the chord (unit element) with its slope.
struct Turn {
  Mat rotation;
  Vec jacobian_x, jacobian_y, chord, chord_x, chord_y;
};

inline Turn make_turn(double wx, double wy) {
  const double t2 = wx * wx + wy * wy;
  // sin t / t, (1 - cos t) / t^2, (t - sin t) / t^3 and twice the slopes of the first two in t^2
  double a = 0, b = 0, c = 0, da = 0, db = 0, power = 1, factorial = 1;
  for (int k = 0; k < 12; ++k) {
    const double sign = k % 2 ? -1.0 : 1.0;
    const double even = factorial;          // (2k)!
    const double odd = even * (2 * k + 1);  // (2k+1)!
    a += sign * power / odd;
    b += sign * power / (odd * (2 * k + 2));
    c += sign * power / (odd * (2 * k + 2) * (2 * k + 3));
    const double next = sign * -1.0 * 2 * (k + 1) * power;
    da += next / (odd * (2 * k + 2) * (2 * k + 3));
    db += next / (odd * (2 * k + 2) * (2 * k + 3) * (2 * k + 4));
    factorial = odd * (2 * k + 2);
    power *= t2;
  }
  Turn turn;
  turn.rotation = {
      {1 - b * wy * wy, b * wx * wy, -a * wy}, {b * wx * wy, 1 - b * wx * wx, a * wx}, {a * wy, -a * wx, 1 - b * t2}};
  turn.jacobian_x = {1 - c * wy * wy, c * wx * wy, -b * wy};
  turn.jacobian_y = {c * wx * wy, 1 - c * wx * wx, b * wx};
  turn.chord = {b * wy, -b * wx, a};
  turn.chord_x = {db * wx * wy, -b - db * wx * wx, da * wx};
  turn.chord_y = {b + db * wy * wy, -db * wx * wy, da * wy};
  return turn;
}

}  // namespace oracle
