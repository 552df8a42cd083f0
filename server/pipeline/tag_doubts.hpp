#pragma once

#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimation/checks/rejection_watch.hpp"
#include "estimation/checks/size_check.hpp"
#include "pipeline/up_check.hpp"

namespace fiducap {

/// Example: `tag 7 looks 12 % larger than its configured 0.100 m (0.112 ± 0.002 m): measure it, or
/// set tags.sizes_m`.
[[nodiscard]] std::string size_text(const SizeFinding& finding);
/// @param share  of the sightings that was rejected
[[nodiscard]] std::string rejection_text(double share, bool has_imu);

/// What a person should look at when tags do not fit together, in words. Nothing is corrected.
class TagDoubts final {
 public:
  /// @param is_surveyed  tags' places were told
  TagDoubts(const BodySensors& sensors, const EstimatorConfig& config,
            const WorkspaceGauge& gauge = {}, bool is_surveyed = false)
      : sizes_(sensors, config.corner_noise_px),
        up_(sensors.imu.has_value(), gauge, is_surveyed),
        has_imu_(sensors.imu.has_value()) {}

  void add(const ImuSample& imu) { sizes_.add(imu); }
  /// What was learned about the cameras.
  void learn(std::span<const ExtrinsicsEstimate> cameras) {
    for (std::size_t k = 0; k < cameras.size(); ++k) sizes_.set_lens(k, cameras[k].lens.offset);
  }
  /// @param estimate  nullopt: the filter does not run
  /// @return what is new, as one line; empty most of the time
  [[nodiscard]] std::string add(const TagObservations& seen, const UpdateReport& report,
                                const std::optional<BodyEstimate>& estimate,
                                std::span<const TagBelief> own, std::span<const KnownTag> known);
  /// All that was said, oldest first. From any thread.
  [[nodiscard]] std::vector<std::string> said() const;

 private:
  /// Without an IMU a body waits until it is certain which of a tag's two poses is the right one.
  [[nodiscard]] std::string wait_for_branch(const UpdateReport& report, bool has_pose);
  /// Known tags say that the body is elsewhere, and nobody decides.
  [[nodiscard]] std::string wait_for_witness(const UpdateReport& report);

  SizeCheck sizes_;
  RejectionWatch rejections_;
  UpCheck up_;
  bool has_imu_;
  std::optional<Instant> waits_since_;
  bool is_wait_told_{false};  ///< Of this one.
  std::optional<Instant> elsewhere_since_;
  bool is_elsewhere_told_{false};
  mutable std::mutex mutex_;
  std::vector<std::string> said_;
};

}  // namespace fiducap
