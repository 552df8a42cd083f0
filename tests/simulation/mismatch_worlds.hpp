#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "mapping/tag_map.hpp"
#include "simulation/estimation_data.hpp"
#include "simulation/filter_run.hpp"

namespace fiducap {

/// One difference between world and configuration.
struct Mismatch {
  using Faults = std::function<void(SimulatedDataSetup&, const EstimationData& clean)>;
  using Data = std::function<void(EstimationData&, std::uint64_t seed)>;
  using Map = std::function<TagMap(const EstimationData&, std::uint64_t seed)>;

  std::string name;
  Faults faults{};  ///< Changes of the simulator.
  Data data{};      ///< Changes of its samples or of the configuration.
  /// Name of the unmodified run that this row is compared with. It has the changes below, too.
  std::string base{};
  Data base_data{};
  Map map{}, base_map{};  ///< Initial map of the run and of its base; nullptr: none.

  [[nodiscard]] bool is_unmodified() const { return !faults && !data && !map; }
};

/// The rows of docs/design/mismatch.md; the first one is "nothing".
[[nodiscard]] const std::vector<Mismatch>& mismatches();
[[nodiscard]] const Mismatch& mismatch_named(const std::string& name);

/// Whether a cause that a message names is what is wrong in this row.
[[nodiscard]] bool is_right(const NamedCause& cause, const Mismatch& mismatch,
                            const EstimationData& data);

/// The world of `setup` without the mismatch, and with it. The truth stays the truth in both.
[[nodiscard]] EstimationData unmodified_world(const SimulatedDataSetup& setup,
                                              const Mismatch& mismatch);
[[nodiscard]] EstimationData mismatched_world(SimulatedDataSetup setup, const Mismatch& mismatch);

}  // namespace fiducap
