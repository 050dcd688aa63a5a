// A guard that cannot fail proves nothing: each planted use of the heap must be caught, in optimised builds too.
#include "no_alloc.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace no_alloc_test {

using ctcr::test::HeapGuard;

// Keeps the optimiser from removing an allocation whose result nobody needs.
template <class T>
void keep(T* pointer) {
  asm volatile("" : : "g"(pointer) : "memory");
}

TEST(HeapGuard, SeesNothingWhereNothingIsAllocated) {
  const HeapGuard guard;
  Eigen::Matrix4d a = Eigen::Matrix4d::Identity();
  keep(&a);
  a = (a * a).eval();
  keep(&a);
  EXPECT_EQ(guard.uses(), 0);
}

TEST(HeapGuard, CatchesPlantedNew) {
  const HeapGuard guard;
  const auto pointer = std::make_unique<int>(1);
  keep(pointer.get());
  EXPECT_EQ(guard.uses(), 1);
}

TEST(HeapGuard, CatchesPlantedAlignedNew) {
  struct alignas(64) Block {
    double x[8];
  };
  const HeapGuard guard;
  const auto pointer = std::make_unique<Block>();
  keep(pointer.get());
  EXPECT_EQ(guard.uses(), 1);
}

TEST(HeapGuard, CatchesPlantedMalloc) {
  const HeapGuard guard;
  void* pointer = std::malloc(8);
  keep(pointer);
  EXPECT_EQ(guard.uses(), 1);
  std::free(pointer);
  EXPECT_EQ(guard.uses(), 2);
}

TEST(HeapGuard, CatchesTheRestOfTheMallocFamily) {
  const HeapGuard guard;
  void* zeroed = std::calloc(2, 8);
  keep(zeroed);
  void* grown = std::realloc(zeroed, 64);
  keep(grown);
  void* aligned = std::aligned_alloc(64, 64);
  keep(aligned);
  EXPECT_EQ(guard.uses(), 3);
  std::free(grown);
  std::free(aligned);
}

TEST(HeapGuard, CatchesDelete) {
  auto pointer = std::make_unique<int>(1);
  keep(pointer.get());
  const HeapGuard guard;
  pointer.reset();
  EXPECT_EQ(guard.uses(), 1);
}

TEST(HeapGuard, CatchesAMatrixOfUnknownSize) {
  const HeapGuard guard;
  const Eigen::MatrixXd matrix(3, 3);
  keep(matrix.data());
  EXPECT_GE(guard.uses(), 1);
}

TEST(HeapGuard, CatchesWhatTheStandardLibraryAllocates) {
  const HeapGuard guard;
  const std::string text(1000, 'x');
  keep(text.data());
  EXPECT_GE(guard.uses(), 1);
}

TEST(HeapGuard, CatchesOtherThreads) {
  const HeapGuard guard;
  long seen = 0;
  std::thread([&] {
    const long before = guard.uses();
    const std::vector<double> block(100);
    keep(block.data());
    seen = guard.uses() - before;
  }).join();
  EXPECT_EQ(seen, 1);
}

TEST(HeapGuard, IsQuietAfterItsLife) {
  {
    const HeapGuard guard;
  }
  const auto pointer = std::make_unique<int>(1);
  keep(pointer.get());
  const HeapGuard guard;
  EXPECT_EQ(guard.uses(), 0);
}

}  // namespace no_alloc_test
