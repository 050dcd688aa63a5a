"""Starts an effect of your own: its header, its test and its line in the catalogue.

NAME is its id, in snake_case. The skeleton is a complete effect (a precurvature that is relatively too large, one value
for each tube) whose test passes; change its words, its parameters and its hook.
"""

import re
import sys
from pathlib import Path

HEADER = """\
#pragma once
#include "ctcr/effects/hooks.hpp"

namespace ctcr {
namespace @id@ {
inline constexpr EffectInfo info{
    .id = "@id@",
    .title = "@title@",
    .physics = "What happens, in plain words.",
    .signature = "How the error looks.",
    .measure = "What to measure to see it and to tell it from its look-alikes.",
    .look_alikes = "",  // ids, separated by spaces
    .reference = "",
    .needs = {},  // order, time, orientation, loads, gravity
};
// Neutral values change nothing. Values beyond the soft bounds are hardly this physics; those beyond the hard bounds
// are impossible.
inline constexpr std::array parameters{
    EffectParameter{.name = "size",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.05,
                    .soft = {-0.2, 0.2},
                    .hard = {-0.9, 0.9},
                    .per_tube = true,
                    .meaning = "relative"},
};
}  // namespace @id@

/// What it computes, as a formula.
template <int N, class P = double>
struct @Name@ : EffectValues<@id@::parameters, N, P> {
  static constexpr const EffectInfo& info = @id@::info;

  // One or more of the hooks of hooks.hpp. Compute with P throughout: it carries the derivatives.
  void material(const TubePoint<P>& place, Material<P>& m) const noexcept {
    if (place.curved) m.curvature[0] = m.curvature[0] * (1.0 + this->template get<0>(place.tube));
  }
};

}  // namespace ctcr
"""

TEST = """\
#include "ctcr/effects/@id@.hpp"

#include <gtest/gtest.h>

#include "ctcr/recording/derivatives.hpp"
#include "support/laws.hpp"

namespace ctcr {
namespace @id@_test {

using Alone = EffectList<@Name@>;
using Parameters = SystemParameters<2, Alone>;
constexpr int first = ParameterVector<2>::count;

/// Two readings of a robot with motors that are its joints, the second one of interest.
struct Case {
  System<2, Alone> system;
  std::vector<RecordedRow<2>> rows;
  Workspace<2> ws;

  explicit Case(test::Random& random)
      : system{{1, 1, {0, 0}, {0, 0}}, Model<2, Alone>(Robot<2>{}), {}, {.tolerance = 1e-12}} {
    const auto c = test::smooth_case<2>(random, 0.1, 0, test::tilted_gravity);
    system.model = Model<2, Alone>(c.robot);
    for (const double back : {0.5, 0.0})
      rows.push_back({{c.q.beta, c.q.alpha - back * VecN<2>::Ones()}, c.load, {.time = -back, .part = 1 - back}});
  }
  RecordedPrediction<2, Alone> predicted(const System<2, Alone>& with) {
    RecordedPrediction<2, Alone> prediction;
    EXPECT_EQ(predict(with, rows.back(), histories<2, Alone>(with, rows).back(), ws, prediction), Status::ok);
    return prediction;
  }
};

TEST(@Name@, ChangesNothingAtNeutralValues) {
  test::Random random(1);
  for (int n = 0; n < 5; ++n) {
    Case c(random);
    const auto& row = c.rows.back();
    const Solution<2> plain = test::solved<Derivatives::none>(
        c.system.model.robot(), {row.theta.translation, row.theta.rotation}, row.load);
    EXPECT_LE((c.predicted(c.system).reading.position - plain.position).norm(), 1e-9);
  }
}

TEST(@Name@, HasExactDerivatives) {
  test::Random random(2);
  using Effect = @Name@<2>;
  std::vector<double> sigma;
  for (std::size_t k = 0; k < @id@::parameters.size(); ++k)
    sigma.insert(sigma.end(), std::size_t(Effect::size(int(k))), @id@::parameters[k].sigma);
  for (int n = 0; n < 5; ++n) {
    Case c(random);
    Eigen::VectorXd x = Parameters::values(c.system);
    for (int k = 0; k < Effect::count; ++k) x[first + k] += sigma[std::size_t(k)];
    const auto at = [&](int k, double change) {
      Eigen::VectorXd moved = x;
      moved[first + k] += change;
      return Parameters::with_values(c.system, moved);
    };
    for (int k = 0; k < Effect::count; ++k) {
      const auto prediction = c.predicted(at(k, 0));
      Eigen::Matrix<double, 6, Eigen::Dynamic> exact(6, 1);
      const std::vector variable{first + k};
      ASSERT_EQ((differentiate<2, Alone>(at(k, 0), c.rows.back(), c.ws, prediction, variable, exact)), Status::ok);
      const double h = 0.01 * sigma[std::size_t(k)];
      const Vec6 slope = test::slope([&](double change) { return c.predicted(at(k, change)).reading; }, h);
      const double allowed = 1e-6 * (1e-4 / sigma[std::size_t(k)] + slope.norm());
      EXPECT_LE((exact - slope).norm(), allowed) << Parameters::name(first + k);
    }
  }
}

}  // namespace @id@_test
}  // namespace ctcr
"""


def written(template: str, name: str) -> str:
    words = name.split("_")
    camel = "".join(word.capitalize() for word in words)
    title = " ".join(words).capitalize()
    return template.replace("@id@", name).replace("@Name@", camel).replace("@title@", title)


def with_effect(catalogue: str, name: str) -> str:
    """The text of catalogue.hpp with the effect: its include in its place, its type at the end of the list."""
    lines = catalogue.splitlines()
    includes = [i for i, line in enumerate(lines) if line.startswith("#include")]
    lines[includes[0] : includes[-1] + 1] = sorted(
        [*(lines[i] for i in includes), f'#include "ctcr/effects/{name}.hpp"']
    )
    end = next(i for i, line in enumerate(lines) if line.endswith(">;"))
    lines[end] = lines[end].removesuffix(">;") + ","
    lines.insert(end + 1, " " * 29 + written("@Name@>;", name))
    return "\n".join(lines) + "\n"


def main(arguments: list[str], root: Path) -> int:
    if len(arguments) != 1:
        print("usage: tools/dev new-effect NAME", file=sys.stderr)
        return 2
    name = arguments[0]
    if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name):
        print(f"new-effect: '{name}' is no id: use lower-case words joined by _, such as cable_pull", file=sys.stderr)
        return 2
    header = root / "include/ctcr/effects" / f"{name}.hpp"
    test = root / "tests/effects" / f"{name}_test.cpp"
    catalogue = root / "include/ctcr/effects/catalogue.hpp"
    described = [path for path in header.parent.glob("*.hpp") if f'.id = "{name}"' in path.read_text(encoding="utf-8")]
    taken = [*described, *(path for path in (header, test) if path.exists())]
    if taken:
        print(
            f"new-effect: {name} exists already, in {taken[0].relative_to(root)}; choose another name", file=sys.stderr
        )
        return 1
    listed = with_effect(catalogue.read_text(encoding="utf-8"), name)
    header.write_text(written(HEADER, name), encoding="utf-8")
    test.write_text(written(TEST, name), encoding="utf-8")
    catalogue.write_text(listed, encoding="utf-8")
    for path in (header, test, catalogue):
        print(path.relative_to(root))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], Path(__file__).parents[1]))
