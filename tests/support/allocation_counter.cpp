#include "support/allocation_counter.hpp"

#include <pthread.h>
#include <stddef.h>

#include <array>
#include <cstdlib>
#include <new>
#include <string_view>

namespace fiducap {
std::atomic<std::uint64_t> g_allocations{0};

namespace {
std::atomic<int> g_until_fault{0};  ///< 0: none will fail.
std::atomic<const char*> g_name_begin{""};
thread_local bool t_in_reach = false;

bool is_in_reach() {
  const char* begin = g_name_begin.load(std::memory_order_relaxed);
  if (t_in_reach || *begin == '\0') return t_in_reach;
  std::array<char, 16> name{};
  return ::pthread_getname_np(::pthread_self(), name.data(), name.size()) == 0 &&
         std::string_view(name.data()).starts_with(begin);
}
bool must_fail() {
  return g_until_fault.load(std::memory_order_relaxed) > 0 && is_in_reach() &&
         g_until_fault.fetch_sub(1) == 1;
}
}  // namespace

void AllocationFault::reach_this_thread() { t_in_reach = true; }
void AllocationFault::reach_threads(const char* name_begin) { g_name_begin = name_begin; }
void AllocationFault::arm(int nth) { g_until_fault = nth; }
bool AllocationFault::disarm() { return g_until_fault.exchange(0) <= 0; }
}  // namespace fiducap

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define FIDUCAP_SANITIZED
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define FIDUCAP_SANITIZED
#endif

// Eigen and C libraries call malloc itself, newer versions of Asio aligned_alloc. Sanitizers own
// both, so there only operator new is counted.
#ifndef FIDUCAP_SANITIZED
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void* malloc(std::size_t size) {
  ++fiducap::g_allocations;
  return __libc_malloc(size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++fiducap::g_allocations;
  return fiducap::must_fail() ? nullptr : __libc_memalign(alignment, size);
}
}
#define FIDUCAP_ALIGNED_ALLOC __libc_memalign
#else
#define FIDUCAP_ALIGNED_ALLOC std::aligned_alloc
#endif

bool fiducap::AllocationCounter::counts_malloc() {
#ifdef FIDUCAP_SANITIZED
  return false;
#else
  return true;
#endif
}

namespace {
void* try_counted(std::size_t size, std::size_t alignment) noexcept {
  ++fiducap::g_allocations;
  const std::size_t rounded = (size + alignment - 1) / alignment * alignment;
  return FIDUCAP_ALIGNED_ALLOC(alignment, rounded == 0 ? alignment : rounded);
}
void* counted(std::size_t size, std::size_t alignment) {
  if (fiducap::must_fail()) throw std::bad_alloc();
  if (void* p = try_counted(size, alignment)) return p;
  throw std::bad_alloc();
}
}  // namespace

void* operator new(std::size_t size) { return counted(size, alignof(::max_align_t)); }
void* operator new[](std::size_t size) { return counted(size, alignof(::max_align_t)); }
void* operator new(std::size_t size, std::align_val_t a) {
  return counted(size, static_cast<std::size_t>(a));
}
void* operator new[](std::size_t size, std::align_val_t a) {
  return counted(size, static_cast<std::size_t>(a));
}
// Memory of a sanitizer's own nothrow forms would be released by free() below.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return try_counted(size, alignof(::max_align_t));
}
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return try_counted(size, alignof(::max_align_t));
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete[](void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete[](void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }
