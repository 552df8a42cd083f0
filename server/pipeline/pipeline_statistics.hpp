#pragma once

#include <cstdint>

#include "base/this_thread.hpp"
#include "base/time.hpp"
#include "capture/sample_merger.hpp"
#include "pipeline/guided_search.hpp"

namespace fiducap {

/// What a body did and what it cost.
struct PipelineStatistics {
  std::uint64_t imu_samples{};
  std::uint64_t frames{};
  std::uint64_t frames_with_pose{};  ///< … in the workspace, and used tags.
  std::uint64_t tags_used{};
  std::uint64_t motion_losses{};
  Duration propagate_cpu{};
  Duration detect_cpu{};
  Duration update_cpu{};    ///< Correction with the corners and everything after it.
  std::uint64_t skipped{};  ///< Images left out by `skip`.
  MergerStatistics merger{};
  SearchStatistics search{};  ///< Of images; all zero when the source gives corners.

  PipelineStatistics& operator+=(const PipelineStatistics& other);
};

/// Adds the CPU time between its birth and its death.
class CpuMeter final {
 public:
  explicit CpuMeter(Duration& sum) : sum_(sum), begin_(thread_cpu_time()) {}
  ~CpuMeter() { sum_ += thread_cpu_time() - begin_; }
  CpuMeter(const CpuMeter&) = delete;
  CpuMeter& operator=(const CpuMeter&) = delete;

 private:
  Duration& sum_;
  Duration begin_;
};

}  // namespace fiducap
