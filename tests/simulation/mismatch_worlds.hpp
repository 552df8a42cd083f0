#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "simulation/estimation_data.hpp"

namespace fiducap {

/// One difference between world and configuration.
struct Mismatch {
  using Faults = std::function<void(SimulatedDataSetup&, const EstimationData& clean)>;
  using Data = std::function<void(EstimationData&, std::uint64_t seed)>;

  std::string name;
  Faults faults{};  ///< Changes of the simulator.
  Data data{};      ///< Changes of its samples or of the configuration.
  /// Name of the unmodified run that this row is compared with. It has the changes below, too.
  std::string base{};
  Data base_data{};
};

/// The rows of docs/design/mismatch.md; the first one is "nothing".
[[nodiscard]] const std::vector<Mismatch>& mismatches();
[[nodiscard]] const Mismatch& mismatch_named(const std::string& name);

/// The world of `setup` without the mismatch, and with it. The truth stays the truth in both.
[[nodiscard]] EstimationData unmodified_world(const SimulatedDataSetup& setup,
                                              const Mismatch& mismatch);
[[nodiscard]] EstimationData mismatched_world(SimulatedDataSetup setup, const Mismatch& mismatch);

}  // namespace fiducap
