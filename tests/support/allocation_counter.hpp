#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <new>

namespace fiducap {

/// Counts every operator new of this program. Link `fiducap_allocation_counter` (it replaces the
/// global operators).
extern std::atomic<std::uint64_t> g_allocations;

/// `AllocationCounter c; …; EXPECT_EQ(c.count(), 0)`
class AllocationCounter final {
 public:
  AllocationCounter() : start_(g_allocations.load()) {}
  /// False under sanitizers, which own malloc: there only operator new is counted.
  [[nodiscard]] static bool counts_malloc();
  [[nodiscard]] std::uint64_t count() const { return g_allocations.load() - start_; }

 private:
  std::uint64_t start_;
};

/// Makes one operator new throw bad_alloc: in the chosen threads, the n-th from `arm` on.
/// Thread-safe. Link `fiducap_allocation_counter`.
class AllocationFault final {
 public:
  static void reach_this_thread();
  /// Chooses threads by the begin of their name. @param name_begin  a literal; "": none
  static void reach_threads(const char* name_begin);
  static void arm(int nth);
  /// @return false: there were fewer allocations, none has failed
  static bool disarm();
};

/// Leaves no zeros on the stack below the caller.
__attribute__((noinline)) inline void dirty_the_stack() {
  std::array<volatile char, 16 * 1024> bytes;
  for (auto& byte : bytes) byte = '\x5a';
}

/// Runs `work` until each of its operator new has failed once. It may throw bad_alloc.
template <typename Work>
void fail_each_allocation(Work&& work) {
  AllocationFault::reach_this_thread();
  bool failed = true;
  for (int nth = 1; failed; ++nth) {
    dirty_the_stack();
    AllocationFault::arm(nth);
    try {
      work();
    } catch (const std::bad_alloc&) {
    }
    failed = AllocationFault::disarm();
  }
}

}  // namespace fiducap
