// Preloaded into fiducapd by ./dev chaos: an `operator new` that fails on request.
//
// SIGUSR2 arms one failure: odd ones for the main thread (all sockets), even ones for the others
// (filters, publisher, watch, recorder, map keeper). It hits a later allocation, not always the
// same, and expires after a second. The file named by FIDUCAP_CHAOS_COUNT has the number of
// exceptions.
#include <execinfo.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <new>

namespace {

constexpr std::int64_t kExpiresAfterNs = 1'000'000'000;
constexpr std::uint32_t kFurthest = 48;  // allocations away

std::atomic<std::int64_t> armed_until_ns{0};
std::atomic<bool> for_main{false};
std::atomic<std::uint32_t> away{0};
std::atomic<std::uint32_t> signals{0};
std::atomic<std::uint32_t>* thrown{nullptr};

std::int64_t now_ns() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
}

void arm(int) {
  const std::uint32_t n = ++signals;
  for_main = n % 2 == 1;
  away = (n * 2654435761u >> 16) % kFurthest;  // spread, and the same in every run
  armed_until_ns = now_ns() + kExpiresAfterNs;
}

/// Prints the stack of an uncaught exception, for addr2line.
[[noreturn]] void print_stack_and_abort() {
  void* frames[64];
  backtrace_symbols_fd(frames, backtrace(frames, 64), STDERR_FILENO);
  std::abort();
}

__attribute__((constructor)) void begin() {
  std::set_terminate(print_stack_and_abort);
  struct sigaction action {};
  action.sa_handler = arm;
  action.sa_flags = SA_RESTART;
  sigaction(SIGUSR2, &action, nullptr);
  const char* path = std::getenv("FIDUCAP_CHAOS_COUNT");
  if (path == nullptr) return;
  const int file = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (file < 0 || ftruncate(file, 4096) != 0) return;
  void* page = mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  if (page != MAP_FAILED) thrown = static_cast<std::atomic<std::uint32_t>*>(page);
}

bool fails_now() {
  const std::int64_t until = armed_until_ns.load(std::memory_order_relaxed);
  if (until == 0) return false;
  if ((syscall(SYS_gettid) == getpid()) != for_main.load()) return false;
  if (away.load() > 0) {
    --away;
    return false;
  }
  return armed_until_ns.exchange(0) != 0 && now_ns() < until;
}

}  // namespace

void* operator new(std::size_t size) {
  if (fails_now()) {
    if (thrown != nullptr) ++*thrown;
    throw std::bad_alloc();
  }
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
