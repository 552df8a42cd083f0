#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "tools/replay/run_errors.hpp"

namespace fiducap {

/// One body of a run, by its recording. The run stays with the caller.
struct RunBody {
  std::string name;
  std::string recording;  ///< Its folder: truth is taken from there.
  const OfflineSetup* setup{};
  const OfflineResult* result{};
};

/// Whether a run may be written here. A folder holds one run, never parts of two: an earlier one is
/// replaced whole.
/// @return Error when files of the same names are there that no run of ours has written
[[nodiscard]] Expected<void> check_run_folder(const std::string& folder);

/// The results of a run, beside each other in one folder, each written whole and then renamed:
/// `<body>.tum`, `<body>.covariance.csv`, with truth `<body>.truth.tum`, with several bodies
/// `<body>.extrinsics.yaml`, else `extrinsics.yaml`; parts (part_name); `map.csv`, `events.csv`,
/// and `report.json`, which lists them.
/// @param plots  `plots.html`; empty: there is none
[[nodiscard]] Expected<void> write_run_files(const std::string& folder,
                                             std::span<const RunBody> bodies,
                                             const OfflineSession& session,
                                             const std::string& plots = {});
/// @return Error when report.json beside a trajectory does not list it.
[[nodiscard]] Expected<void> check_same_run(const std::string& tum);

/// `<body>.1.part` and so on: `.tum` has the poses, `.csv` the tags of a part that is not
/// connected to the workspace (OfflinePart).
[[nodiscard]] std::string part_name(const std::string& body, std::size_t part);

/// `report.json` as text: of the one body, or `bodies`.
[[nodiscard]] std::string run_report(std::span<const RunBody> bodies,
                                     const OfflineSession& session);

/// Known and estimated tags of all bodies together, sorted by id; of two estimates the more certain
/// one.
[[nodiscard]] TagMap run_map(std::span<const RunBody> bodies);

/// Of the tags for which `is_wanted` holds.
[[nodiscard]] std::vector<TagPlace> places_in(
    const TagMap& map,
    const std::function<bool(const MapTag&)>& is_wanted = [](const MapTag&) { return true; });

/// Why a run has no pose, with what to do about it.
[[nodiscard]] std::string no_pose_text(const OfflineResult& result, const OfflineSetup& setup);

/// A camera as a run has it.
struct RunCamera {
  Pose X_BV;
  LensOffset lens;
};

/// The recordings' format: `camK: T_BS: data: [16]`, sensor to body, rows first. Where the lens
/// differs from the recording's, also `lens: {focal: …, centre_px: [u, v], k1: …}`, how much
/// larger each is (LensOffset).
[[nodiscard]] std::string to_extrinsics_yaml(const std::vector<RunCamera>& cameras);
/// @return one per camera 0 … cameras-1; Error naming what is missing or no rotation.
[[nodiscard]] Expected<std::vector<RunCamera>> extrinsics_from_yaml(const std::string& text,
                                                                    std::size_t cameras,
                                                                    const std::string& context);

/// `<body>.tum`, one line per pose: `t tx ty tz qx qy qz qw`, t in seconds with nine decimals, made
/// from the integer nanoseconds without rounding. Numbers read back as the same doubles.
[[nodiscard]] std::string to_tum(std::span<const StampedPose> poses);
/// `<body>.covariance.csv`, one line per pose: nanoseconds, then the upper triangle row by row
/// (position and rotation vector, both in W axes). Numbers read back as the same doubles.
[[nodiscard]] std::string to_covariance_csv(std::span<const StampedCovariance> covariances);

/// Comments (`#`) and empty lines are skipped; attitudes are normalised.
/// @return in the file's order; Error with the line number for anything else, also for time that
/// does not increase.
[[nodiscard]] Expected<std::vector<StampedPose>> tum_from(std::string_view text,
                                                          const std::string& context);
/// The same; also an Error for negative variances.
[[nodiscard]] Expected<std::vector<StampedCovariance>> covariances_from_csv(
    std::string_view text, const std::string& context);

}  // namespace fiducap
