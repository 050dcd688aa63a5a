// Body of solve_paper_robot() for whichever form of Lanes the including file has chosen. No include guard, no includes.
/// See scalar.hpp.
inline void solve_to_numbers(const double (&joints)[6], const double (&load)[6], const double (&gravity)[3],
                             bool with_compliance, double* out) {
  Robot<3> robot = test::paper_robot();
  robot.gravity = Vec3(gravity[0], gravity[1], gravity[2]);
  const Joints<3> q{{joints[0], joints[1], joints[2]}, {joints[3], joints[4], joints[5]}};
  const TipLoad tip{{load[0], load[1], load[2]}, {load[3], load[4], load[5]}};
  const Model<3> model(robot);
  Workspace<3> ws;
  Solution<3> s;
  const Status status = with_compliance ? solve<Derivatives::compliance>(model, q, tip, ws, s)
                                        : solve<Derivatives::jacobian>(model, q, tip, ws, s);
  *out++ = static_cast<double>(status);
  const auto put = [&](const auto& matrix) {
    for (const double x : matrix.reshaped()) *out++ = x;
  };
  put(s.position);
  put(s.rotation);
  put(s.jacobian);
  put(s.compliance);
  *out = s.stability;
}
