#pragma once

#include <array>
#include <cstddef>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "capture/lens/camera_model.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/found_mismatch.hpp"

/// Messages about a configuration that does not fit the measurements. Nothing is corrected here.
namespace fiducap {

/// Message with a remedy, e.g. `camera 0: the lens seems 0.9 ± 0.1 % longer than configured (fu
/// 460.0, seems 464.1); this is corrected for. Run fiducap calibrate camera`.
[[nodiscard]] std::string mismatch_text(const FoundMismatch& found,
                                        const std::vector<CameraMount>& cameras);

/// Reports each mismatch once it lasts, and again when it has changed considerably.
class MismatchReporter final {
 public:
  /// @return what is to be reported; usually nothing
  [[nodiscard]] std::vector<FoundMismatch> take(const std::vector<FoundMismatch>& found,
                                                Instant now);

 private:
  struct Known {
    FoundMismatch found;  ///< As reported.
    Instant since{};
    bool is_reported{false};
  };
  std::vector<Known> known_;
};

/// The vertical by most tags: upright on walls (y axis), face up on the floor, face down on the
/// ceiling.
struct UpGuess {
  Eigen::Vector3d up_W;
  int agree{};  ///< Number of tags that agree …
  int of{};     ///< … out of this many.
};

/// @return nullopt: fewer than three tags, or all on one wall or floor (ambiguous)
[[nodiscard]] std::optional<UpGuess> guess_up(std::span<const TagBelief> tags);

/// Without an IMU the vertical is unknown: z of the workspace is the normal of the first tag.
/// Reports that this is a guess, and whether the other tags agree. Never turns the workspace, since
/// poses have been published.
class UpCheck final {
 public:
  /// @param is_surveyed  tag poses are configured, and so is the vertical
  UpCheck(bool has_imu, const WorkspaceGauge& gauge, bool is_surveyed)
      : gauge_(gauge), is_over_(has_imu || gauge.X_WT || is_surveyed) {}

  /// @return a new message; usually empty
  [[nodiscard]] std::string add(Instant at, const std::optional<BodyEstimate>& estimate,
                                std::span<const TagBelief> own, std::span<const KnownTag> known);

 private:
  [[nodiscard]] std::string wait_for_floor(Instant at, std::span<const TagBelief> own);

  WorkspaceGauge gauge_;
  bool is_over_;  ///< Nothing more to report.
  bool is_guess_reported_{false};
  bool is_wait_reported_{false};
  std::optional<Instant> waits_since_;
  std::optional<Instant> guessed_at_;
};

/// Detects that a large share of the tags in view is rejected over many seconds: a common cause is
/// wrong (sizes, lens, extrinsics), not a single tag.
class RejectionWatch final {
 public:
  /// Adds an image, in order of time.
  /// @return the share, once when above 30 % over ten seconds; again only after it was below 15 %
  [[nodiscard]] std::optional<double> add(const UpdateReport& report);

 private:
  static constexpr std::size_t kSeconds = 10;

  struct Second {
    int used{0};
    int rejected{0};
  };
  [[nodiscard]] std::optional<double> judge();

  std::array<Second, kSeconds> seconds_{};
  std::size_t full_{0};  ///< Complete seconds.
  std::optional<Instant> begun_at_;
  Second now_{};
  bool reported_{false};
};

/// @param share  of rejected sightings
[[nodiscard]] std::string rejection_text(double share, bool has_imu);

/// Messages about tags that do not fit together.
class TagDoubts final {
 public:
  /// @param is_surveyed  tag poses are configured
  explicit TagDoubts(const BodySensors& sensors, const WorkspaceGauge& gauge = {},
                     bool is_surveyed = false)
      : up_(sensors.imu.has_value(), gauge, is_surveyed), has_imu_(sensors.imu.has_value()) {}

  /// @param estimate  nullopt: the filter does not run
  /// @return a new message of one line; usually empty
  [[nodiscard]] std::string add(const TagObservations& seen, const UpdateReport& report,
                                const std::optional<BodyEstimate>& estimate,
                                std::span<const TagBelief> own, std::span<const KnownTag> known);
  /// The first messages, oldest first. From any thread.
  [[nodiscard]] std::vector<std::string> texts() const;

 private:
  [[nodiscard]] std::string branch_text(const UpdateReport& report, bool has_pose);
  [[nodiscard]] std::string conflict_text(const UpdateReport& report);

  RejectionWatch rejections_;
  UpCheck up_;
  bool has_imu_;
  std::optional<Instant> waits_since_;
  bool is_wait_reported_{false};
  std::optional<Instant> conflict_since_;
  bool is_conflict_reported_{false};
  mutable std::mutex mutex_;
  std::vector<std::string> texts_;
};

}  // namespace fiducap
