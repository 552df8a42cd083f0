#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "base/process.hpp"

namespace fiducap::bench {

/// One line of the table.
struct Row {
  std::string what;
  std::string per;     ///< What one operation is.
  double median_us{};  ///< CPU time of this thread.
  double p99_us{};
  std::string remark;
};

struct Options {
  bool quick{false};  ///< Enough to see that it runs, too little to rely on.

  [[nodiscard]] int repeats(int full) const { return quick ? std::max(3, full / 20) : full; }
};

/// Every operation by itself, in the order given. @param times_us  is sorted
[[nodiscard]] Row row_of(std::string what, std::string per, std::vector<double> times_us,
                         std::string remark = {});

/// Measures `operation` `repeats` times, `batch` of them between two looks at the clock.
template <typename Operation>
std::vector<double> measure(int repeats, int batch, Operation&& operation) {
  std::vector<double> times_us;
  times_us.reserve(static_cast<std::size_t>(repeats));
  for (int r = 0; r < repeats; ++r) {
    const Duration begin = thread_cpu_time();
    for (int b = 0; b < batch; ++b) operation();
    times_us.push_back(to_seconds(thread_cpu_time() - begin) * 1e6 / batch);
  }
  return times_us;
}

// One file each.
void bench_detection(const Options& options, std::vector<Row>& rows);
void bench_streaming(const Options& options, std::vector<Row>& rows);
/// A real server and a real client on loopback, in real time.
void bench_latency(const Options& options, std::vector<Row>& rows);

}  // namespace fiducap::bench
