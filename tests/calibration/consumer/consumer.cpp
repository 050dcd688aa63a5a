// Four points seen from a displaced tracker, registered through the installed headers.
#include <cstdio>
#include <ctcr/calibration/procedures/registration.hpp>

int main() {
  const ctcr::Vec3 displacement(0.3, -0.1, 0.2);
  std::vector<ctcr::Fiducial> points;
  for (const ctcr::Vec3& p : {ctcr::Vec3(0, 0, 0), ctcr::Vec3(0.1, 0, 0), ctcr::Vec3(0, 0.2, 0), ctcr::Vec3(0, 0, 0.1)})
    points.push_back({"point " + std::to_string(points.size() + 1), p, {p + displacement}});
  const ctcr::Registration result = ctcr::register_points(points);
  const double error = (result.T_tracker_base.position - displacement).norm();
  std::printf("%.1e m\n", error);
  return error < 1e-9 ? 0 : 1;
}
