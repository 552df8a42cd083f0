#pragma once

#include <atomic>
#include <functional>
#include <thread>
#include <vector>

namespace fiducap::bench {

/// Calls work(0) … work(count − 1), each once, on several threads. Calls must not write to the same
/// data.
inline void in_parallel(int count, int threads, const std::function<void(int)>& work) {
  std::atomic<int> next{0};
  const auto take = [&] {
    for (int i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::jthread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(take);
  take();
}

}  // namespace fiducap::bench
