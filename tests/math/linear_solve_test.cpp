#include "ctcr/math/linear_solve.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "support/cases.hpp"

namespace ctcr {
namespace linear_solve_test {

constexpr int unknowns = 5, further = 3, rows = unknowns + further, groups = 3, columns = 4 * groups;
/// The unknowns stand anywhere in the lanes.
constexpr auto lane = [](int j) constexpr { return 2 * j + 1; };

using Table = Eigen::Matrix<double, rows, columns>;
using Square = Eigen::Matrix<double, unknowns, unknowns>;

double eliminated(Table& table) {
  LaneRow<groups> row[rows] = {};
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) row[i].add(j, table(i, j));
  const double det = eliminate<unknowns>(row, lane);
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) table(i, j) = row[i][j];
  return det;
}

Square unknowns_of(const Table& table) {
  Square A;
  for (int j = 0; j < unknowns; ++j) A.col(j) = table.topRows<unknowns>().col(lane(j));
  return A;
}

/// Rows solved for the unknowns, which are gone from the further rows: [A B; E F] -> [I A^-1 B; 0 F - E A^-1 B].
void expect_solved(const Table& before, const Table& after, double tolerance) {
  const Square A = unknowns_of(before);
  const Eigen::Matrix<double, unknowns, columns> solved =
      Eigen::MatrixXd(A).fullPivLu().solve(before.topRows<unknowns>());
  Table expected = before;
  expected.topRows<unknowns>() = solved;
  for (int j = 0; j < unknowns; ++j)
    expected.bottomRows<further>() -= before.bottomRows<further>().col(lane(j)) * solved.row(j);
  EXPECT_LT((after - expected).cwiseAbs().maxCoeff(), tolerance * (1 + expected.cwiseAbs().maxCoeff()));
}

TEST(Eliminate, EqualsEigen) {
  std::srand(1);
  for (int n = 0; n < test::cases(300); ++n) {
    Table table = Table::Random();
    for (int j = 0; j < unknowns; ++j) table(j, lane(j)) += 2.5;
    const Table before = table;
    const double det = eliminated(table);
    expect_solved(before, table, 1e-12);
    EXPECT_NEAR(det, unknowns_of(before).determinant(), 1e-11 * std::abs(det));
  }
}

TEST(Eliminate, SwapsRowsWhereAPivotVanishes) {
  std::srand(2);
  for (int n = 0; n < test::cases(300); ++n) {
    Table table = Table::Random();
    // A permutation, slightly disturbed: every natural pivot is tiny.
    for (int i = 0; i < unknowns; ++i)
      for (int j = 0; j < unknowns; ++j)
        table(i, lane(j)) = (i + 1 + n % (unknowns - 1)) % unknowns == j ? 1.5 : 1e-9 * table(i, lane(j));
    const Table before = table;
    const double det = eliminated(table);
    expect_solved(before, table, 1e-12);
    EXPECT_NEAR(det, unknowns_of(before).determinant(), 1e-11 * std::abs(det));
  }
}

TEST(Eliminate, ReportsASingularSystem) {
  std::srand(3);
  Table table = Table::Random();
  table.row(3).setZero();
  EXPECT_EQ(eliminated(table), 0.0);
  EXPECT_TRUE(table.allFinite());
}

}  // namespace linear_solve_test
}  // namespace ctcr
