#pragma once
// Proof that code does not touch the heap: counts calls of operator new and delete and of the malloc family (which
// Eigen calls) from any thread while a guard lives. Link ctcr_no_alloc, which replaces the former and wraps the latter.

namespace ctcr::test {

/// Counts uses of the heap, freeing included, during its life. Guards do not nest.
///
///     const HeapGuard guard;
///     step();
///     EXPECT_EQ(guard.uses(), 0);
class HeapGuard {
public:
  HeapGuard() noexcept;
  ~HeapGuard();
  HeapGuard(const HeapGuard&) = delete;
  HeapGuard& operator=(const HeapGuard&) = delete;

  [[nodiscard]] long uses() const noexcept;
};

}  // namespace ctcr::test
