#pragma once

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

// Counts every request for heap memory of the whole test program by replacing the global operators.
// Include in exactly one source file of a test.
namespace tbm::test {

inline std::atomic<long> heap_requests{0};

// Requests since it was made.
class HeapCounter {
 public:
  long Count() const { return heap_requests.load() - before_; }

 private:
  long before_ = heap_requests.load();
};

inline void* CountedAllocate(std::size_t size, std::size_t alignment) {
  ++heap_requests;
  if (size == 0) size = 1;
  void* memory =
      alignment <= alignof(std::max_align_t)
          ? std::malloc(size)
          : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace tbm::test

// GCC sees malloc behind new and free behind delete only after inlining, and takes it for a
// mismatch.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"

void* operator new(std::size_t size) { return tbm::test::CountedAllocate(size, 1); }
void* operator new[](std::size_t size) { return tbm::test::CountedAllocate(size, 1); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return tbm::test::CountedAllocate(size, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return tbm::test::CountedAllocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
