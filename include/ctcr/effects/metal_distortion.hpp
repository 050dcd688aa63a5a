#pragma once
// The error that a piece of metal near an electromagnetic tracker causes in its readings.
#include "ctcr/math/frame_algebra.hpp"
#include "ctcr/math/functions.hpp"

namespace ctcr {

/// Error of a reading, tracker axes.
template <class P>
struct ReadingError {
  Triple<P> shift;  ///< [m]
  Triple<P> turn;   ///< rotation vector [rad]
};

/// Error of a reading at position p near a small piece of metal at m, to first order in its `volume` [m^3]. Both are in
/// tracker axes, from the middle of three crossed coils. The field B of each coil induces a dipole in the metal, against B
/// (a conductor) or along B (iron: `volume` < 0). The tracker takes the sum of the fields for that of its coils alone and
/// finds the pose that explains it best, which has a closed form. With e = -volume |p|^3 D(p - m) D(m), columns by coil,
/// D(r) = (3 n n^T - 1) / |r|^3, n = p / |p|, w the axial vector of e - e^T and t the part across n:
///   shift = |p| ((2 e^T n - e n)_t / 3 - n (3 n.e n - tr e) / 18),   turn = 3/2 n (n.w) - w.
/// Within 1 cm of the metal or the coils the fields stay finite. Source: a dipole induced by a dipole, Jackson, Classical
/// Electrodynamics, 5.6. Real time: yes.
template <class P>
ReadingError<P> metal_distortion(const Triple<P>& p, const Triple<P>& m, const P& volume) noexcept {
  constexpr double size = 0.01;
  const auto dot = [](const Triple<P>& a, const Triple<P>& b) -> P { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  const auto far = [&](const Triple<P>& a) -> P { return square_root(dot(a, a) + size * size); };
  const auto field = [&](const Triple<P>& r, const P& by, const Triple<P>& v) {  // D(r) v, by = 1 / |r|
    const P cube = by * by * by, along = 3.0 * dot(r, v) * (by * by);
    return Triple<P>{cube * (along * r[0] - v[0]), cube * (along * r[1] - v[1]), cube * (along * r[2] - v[2])};
  };
  const Triple<P> d = difference(p, m);
  const P reach = far(p), by_p = inverse(reach), by_d = inverse(far(d)), by_m = inverse(far(m));
  const Triple<P> n{by_p * p[0], by_p * p[1], by_p * p[2]};
  const P amplitude = -(volume * (reach * reach * reach));
  const Triple<P> en = field(d, by_d, field(m, by_m, n)), ne = field(m, by_m, field(d, by_d, n));
  const P nen = dot(n, en), dm = dot(d, m), dd = by_d * by_d, mm = by_m * by_m, cubes = dd * by_d * (mm * by_m);
  const P trace = cubes * (9.0 * (dm * dm) * (dd * mm) - 3.0 * (dot(d, d) * dd) - 3.0 * (dot(m, m) * mm) + 3.0);
  const P skew = -9.0 * (dm * (dd * mm * cubes));
  const Triple<P> w{skew * (d[1] * m[2] - d[2] * m[1]), skew * (d[2] * m[0] - d[0] * m[2]),
                    skew * (d[0] * m[1] - d[1] * m[0])};
  const P radial = nen * (-1.0 / 3.0) - (3.0 * nen - trace) * (1.0 / 18.0), wn = 1.5 * dot(n, w);
  ReadingError<P> off;
  for (std::size_t i = 0; i < 3; ++i) {
    off.shift[i] = amplitude * reach * ((2.0 * ne[i] - en[i]) * (1.0 / 3.0) + radial * n[i]);
    off.turn[i] = amplitude * (wn * n[i] - w[i]);
  }
  return off;
}

}  // namespace ctcr
