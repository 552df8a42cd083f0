#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "simulation/estimation_data.hpp"

namespace fiducap {

/// One difference between world and configuration.
struct Mismatch {
  using Setup = std::function<void(SimulatedDataSetup&)>;
  using Faults = std::function<void(SimulatedDataSetup&, const EstimationData& clean)>;
  using Data = std::function<void(EstimationData&, std::uint64_t seed)>;

  std::string name;
  Faults faults{};  ///< What the simulator does otherwise, …
  Data data{};      ///< … changes of its samples or of the configuration.
  /// What differs from the other rows without being wrong: the run that this one is compared with
  /// has it too. Rows with the same word in `base` share that run.
  std::string base{};
  Setup base_setup{};
  Data base_data{};
};

/// The rows of docs/design/mismatch.md; the first one is "nothing".
[[nodiscard]] const std::vector<Mismatch>& mismatches();

/// The world of `setup` without the mismatch, and with it. The truth stays the truth in both.
[[nodiscard]] EstimationData unmodified_world(SimulatedDataSetup setup, const Mismatch& mismatch);
[[nodiscard]] EstimationData mismatched_world(SimulatedDataSetup setup, const Mismatch& mismatch);

}  // namespace fiducap
