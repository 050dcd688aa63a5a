#include "ctcr/core/status.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace ctcr {
namespace status_test {

TEST(Status, EachHasItsOwnName) {
  std::set<std::string> names;
  for (const Status status : {Status::ok, Status::joints_out_of_order, Status::tip_behind_plate, Status::not_converged,
                              Status::singular, Status::unstable, Status::inaccurate, Status::needs_solve,
                              Status::not_finite, Status::invalid_robot, Status::invalid_settings})
    names.insert(to_string(status));
  EXPECT_EQ(names.size(), 11u);
  EXPECT_FALSE(names.contains("unknown"));
  EXPECT_STREQ(to_string(static_cast<Status>(200)), "unknown");
}

}  // namespace status_test
}  // namespace ctcr
