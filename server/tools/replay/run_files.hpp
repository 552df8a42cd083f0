#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "tools/replay/pose_errors.hpp"

namespace fiducap {

/// The results of an offline run, beside each other in one folder: `<body>.tum`, `map.csv`,
/// `extrinsics.yaml`, `report.json`. Each is written whole and then renamed.
[[nodiscard]] Expected<void> write_run_files(const std::string& folder, const std::string& body,
                                             const OfflineSetup& setup,
                                             const OfflineResult& result);

/// `report.json` as text.
[[nodiscard]] std::string run_report(const std::string& body, const OfflineSetup& setup,
                                     const OfflineResult& result);

/// Known and estimated tags of a run together, sorted by id.
[[nodiscard]] TagMap run_map(const OfflineSetup& setup, const OfflineResult& result);

/// The recordings' format: `camK: T_BS: data: [16]`, sensor to body, rows first.
[[nodiscard]] std::string to_extrinsics_yaml(const std::vector<Pose>& X_BV);
/// @return one X_BV per camera 0 … cameras-1; Error naming what is missing or no rotation.
[[nodiscard]] Expected<std::vector<Pose>> extrinsics_from_yaml(const std::string& text,
                                                               std::size_t cameras,
                                                               const std::string& context);

}  // namespace fiducap
