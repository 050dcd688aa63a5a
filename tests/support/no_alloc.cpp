#include "no_alloc.hpp"

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace {

// Volatile, so that no optimiser may reason that nobody reads the count.
volatile std::atomic<bool> watching{false};
volatile std::atomic<long> uses{0};

void note_use() noexcept {
  if (watching.load(std::memory_order_relaxed)) uses.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace

namespace ctcr::test {

HeapGuard::HeapGuard() noexcept {
  ::uses.store(0);
  watching.store(true);
}
HeapGuard::~HeapGuard() { watching.store(false); }
long HeapGuard::uses() const noexcept { return ::uses.load(); }

}  // namespace ctcr::test

// The linker's --wrap=malloc sends every call of malloc here, and __real_malloc to the C library.
extern "C" {
void* __real_malloc(std::size_t);
void* __real_calloc(std::size_t, std::size_t);
void* __real_realloc(void*, std::size_t);
void* __real_aligned_alloc(std::size_t, std::size_t);
int __real_posix_memalign(void**, std::size_t, std::size_t);
void __real_free(void*);

void* __wrap_malloc(std::size_t size) {
  note_use();
  return __real_malloc(size);
}
void* __wrap_calloc(std::size_t count, std::size_t size) {
  note_use();
  return __real_calloc(count, size);
}
void* __wrap_realloc(void* pointer, std::size_t size) {
  note_use();
  return __real_realloc(pointer, size);
}
void* __wrap_aligned_alloc(std::size_t alignment, std::size_t size) {
  note_use();
  return __real_aligned_alloc(alignment, size);
}
int __wrap_posix_memalign(void** pointer, std::size_t alignment, std::size_t size) {
  note_use();
  return __real_posix_memalign(pointer, alignment, size);
}
void __wrap_free(void* pointer) {
  note_use();
  __real_free(pointer);
}
}

// The other forms of operator new and delete call these four.
void* operator new(std::size_t size) {
  note_use();
  if (void* pointer = __real_malloc(size > 0 ? size : 1)) return pointer;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  note_use();
  void* pointer = nullptr;
  if (__real_posix_memalign(&pointer, static_cast<std::size_t>(alignment), size) == 0) return pointer;
  throw std::bad_alloc();
}
void operator delete(void* pointer) noexcept {
  note_use();
  __real_free(pointer);
}
void operator delete(void* pointer, std::align_val_t) noexcept {
  note_use();
  __real_free(pointer);
}
void operator delete(void* pointer, std::size_t) noexcept { operator delete(pointer); }
void operator delete(void* pointer, std::size_t, std::align_val_t alignment) noexcept {
  operator delete(pointer, alignment);
}
