#pragma once

#include <optional>
#include <string>
#include <vector>

#include "estimation/body_filter.hpp"
#include "pipeline/agreement/camera_agreement.hpp"

namespace fiducap {

/// A camera's clock that was right and is not any more.
struct ClockJump {
  int camera{};
  Instant at{};        ///< When it was found, by the stamps from then on.
  Duration shift{0};   ///< To be added to the stamps from now on, beyond what is configured …
  Duration change{0};  ///< … and by how much that has changed.
};

/// What a body's pipeline says about its cameras and its gyro.
struct AgreementNews {
  int camera{};
  AgreementFinding finding;
  std::string text;
};

/// Example: `camera 0 looks along other axes than X_BV says: turned by 91° about its optical axis
/// …`.
[[nodiscard]] std::string agreement_text(int camera, const CameraMount& mount,
                                         const AgreementFinding& finding);

/// Whether the cameras of a body and its gyro agree about how it turns, before poses are believed.
///
/// Gets the gyro's readings and the images as they come, with the stamps that they came with:
/// what waits for the other in the order of time is lost when a clock is far off.
class RotationAgreement final {
 public:
  /// Without an IMU it has nothing to compare and says nothing.
  RotationAgreement(const BodySensors& sensors, double corner_noise_px);

  void add(const ImuSample& imu);
  /// An image at this time would be of use. @param stamp  without what a filter has learned
  [[nodiscard]] bool wants(int camera, Instant stamp) const;
  void add(const TagObservations& seen);
  /// What the filter adds to a camera's stamps now.
  void set_used_shift(int camera, double shift_s);

  /// A filter has found that a camera's clock has jumped.
  /// @return what is to be said of it
  std::string note_jump(const UpdateReport::ClockJump& jump);

  /// Once each.
  [[nodiscard]] std::optional<AgreementNews> take_news();
  /// A camera contradicts the gyro: no pose of this body may be believed.
  [[nodiscard]] bool withholds() const;
  /// All cameras were found to agree with the gyro.
  [[nodiscard]] bool is_established() const;
  /// The last one.
  [[nodiscard]] const std::optional<ClockJump>& clock_jump() const { return clock_jump_; }

 private:
  [[nodiscard]] bool has(int camera) const {
    return camera >= 0 && static_cast<std::size_t>(camera) < cameras_.size();
  }

  std::vector<CameraMount> mounts_;
  GyroIntegral gyro_;
  std::vector<CameraAgreement> cameras_;
  std::optional<ClockJump> clock_jump_;
};

}  // namespace fiducap
