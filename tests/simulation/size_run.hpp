#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "estimation/checks/size_check.hpp"
#include "simulation/estimation_data.hpp"

namespace fiducap {

/// Tags with another size than configured.
struct Misprint {
  std::string name;
  double all{1};  ///< printed / configured, of every tag
  double one{1};  ///< … and besides of the tag that is seen most (not the reference)
  std::function<void(simulation::FaultConfig&, int most_seen_tag, double seconds)> fault{};
};

/// Reports during a run, with times.
struct SizeRun {
  struct Said {
    double at_s{};  ///< Since the first sample.
    SizeFinding finding;
  };
  int tag{-1};  ///< The one seen most.
  std::vector<Said> said;
  std::vector<double> rejection_said_at_s;
  std::optional<LogScale> common;
  std::optional<LogScale> by_imu;     ///< of `tag`
  std::optional<LogScale> by_others;  ///< of `tag`
  int used{};
  int rejected{};
};

/// A filter with a misprint, watched by SizeCheck and RejectionWatch.
/// @param setup  without faults
[[nodiscard]] SizeRun run_sizes(SimulatedDataSetup setup, const std::string& filter,
                                const Misprint& misprint);

}  // namespace fiducap
