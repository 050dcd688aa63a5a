// The real-time functions promise not to throw, and that their results are plain data.
#include <gtest/gtest.h>

#include <type_traits>
#include <utility>

#include "ctcr/ctcr.hpp"

namespace ctcr {
namespace noexcept_test {

template <int N, Derivatives D>
constexpr bool promises =
    noexcept(solve<D>(std::declval<const Model<N>&>(), std::declval<const Joints<N>&>(), std::declval<const TipLoad&>(),
                      std::declval<Workspace<N>&>(), std::declval<Solution<N>&>(), std::declval<const Settings&>())) &&
    noexcept(step<D>(std::declval<const Model<N>&>(), std::declval<const Joints<N>&>(), std::declval<const TipLoad&>(),
                     std::declval<Workspace<N>&>(), std::declval<Solution<N>&>(), std::declval<const Settings&>())) &&
    noexcept(check_joints(std::declval<const Robot<N>&>(), std::declval<const Joints<N>&>())) &&
    std::is_nothrow_constructible_v<Model<N>, const Robot<N>&>;

TEST(Noexcept, SolveAndStep) {
  static_assert(promises<1, Derivatives::none> && promises<2, Derivatives::jacobian>);
  static_assert(promises<3, Derivatives::compliance> && promises<4, Derivatives::none>);
  static_assert(noexcept(to_string(Status::ok)) && noexcept(rotation_vector(std::declval<const Mat3&>())) &&
                noexcept(rotation_matrix(std::declval<const Vec3&>())));
}

TEST(Noexcept, NothingOwnsMemory) {
  static_assert(std::is_trivially_destructible_v<Solution<3>> && std::is_trivially_destructible_v<Workspace<3>>);
  static_assert(std::is_trivially_destructible_v<Model<3>>);
}

}  // namespace noexcept_test
}  // namespace ctcr
