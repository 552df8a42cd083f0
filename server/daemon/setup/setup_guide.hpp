#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "calibration/guided/guides.hpp"
#include "daemon/setup/setup_files.hpp"
#include "detection/image_measures.hpp"
#include "detection/tag_detector.hpp"

namespace fiducap {

/// The camera's image, for the user.
struct SetupPicture {
  int width{};
  int height{};
  double rate_hz{};
  ImageMeasures measures;
  ImageBlur blur;
  std::size_t tags{};
  std::string verdict;  ///< A remedy, or that it is good.
  bool is_good{};
};

/// Result of a calibration.
struct SetupVerdict {
  bool is_good{};
  bool is_refused{};  ///< It must not be used.
  std::string summary{};
  std::vector<std::string> advice{};
};

/// Guides the user through the steps of a set-up and keeps the results. No threads, no clock:
/// samples and commands come from one thread. Calibrations run within take(), which may take long;
/// `show` is called before.
class SetupGuide final {
 public:
  /// @param show  called when the state has changed
  SetupGuide(SetupRig& rig, std::function<void()> show);

  void take(const SensorSample& sample);
  /// @return Error: not allowed in this step, or a wrong value
  Expected<void> command(const SetupCommand& command);

  [[nodiscard]] SetupStep step() const { return step_; }
  /// Without an IMU.
  [[nodiscard]] bool is_left_out(SetupStep step) const;
  /// Passed without a result of its own.
  [[nodiscard]] bool is_skipped(SetupStep step) const;
  /// What is missing in this step; nullopt: complete.
  [[nodiscard]] std::optional<std::string> missing() const;
  [[nodiscard]] const SetupResult& result() const { return result_; }
  [[nodiscard]] const std::vector<FoundCamera>& cameras() const { return cameras_; }
  [[nodiscard]] const std::optional<SetupPicture>& picture() const { return picture_; }
  [[nodiscard]] const LensGuide* lens() const { return lens_ ? &*lens_ : nullptr; }
  [[nodiscard]] const RestGuide& rest() const { return rest_; }
  [[nodiscard]] const WaveGuide& wave() const { return wave_; }
  /// Of this step; nullopt: none yet.
  [[nodiscard]] const std::optional<SetupVerdict>& verdict() const { return verdict_; }
  [[nodiscard]] bool is_solving() const { return is_solving_; }
  /// The newest image and its tags.
  [[nodiscard]] const CameraFrame& image() const { return image_; }
  [[nodiscard]] const CornerFrame& corners() const { return corners_; }
  /// 0: no readings.
  [[nodiscard]] double imu_rate_hz() const { return imu_rate_hz_; }

 private:
  static constexpr const char* kMeasuredAtRest = "measured at rest";
  using Handler = Expected<void> (SetupGuide::*)(const SetupCommand&);
  struct Entry;

  void take_image(const CameraFrame& frame);
  void take_imu(const ImuSample& sample);
  void judge_picture();
  void guide_lens();
  void solve_lens();
  void solve_rest();
  void solve_wave();

  Expected<void> look_for_cameras(const SetupCommand& command);
  Expected<void> use_camera(const SetupCommand& command);
  Expected<void> set_camera(const SetupCommand& command);
  Expected<void> set_sheet(const SetupCommand& command);
  Expected<void> keep_guess(const SetupCommand& command);
  Expected<void> use_imu(const SetupCommand& command);
  Expected<void> set_mount(const SetupCommand& command);
  Expected<void> again(const SetupCommand& command);
  Expected<void> next(const SetupCommand& command);
  Expected<void> back(const SetupCommand& command);

  void forget_camera();
  void forget_lens();
  void forget_clock();
  void forget_images();
  [[nodiscard]] SetupStep neighbour(int direction) const;
  void enter(SetupStep step);
  void begin_step();

  SetupRig& rig_;
  std::function<void()> show_;
  SetupStep step_{SetupStep::kCamera};
  SetupResult result_;
  std::vector<FoundCamera> cameras_;
  std::string camera_in_use_{};
  std::optional<SetupPicture> picture_;
  std::optional<LensGuide> lens_;
  RestGuide rest_;
  WaveGuide wave_;
  std::optional<SetupVerdict> verdict_;
  bool is_solving_{false};
  std::optional<TagDetector> detector_;
  CameraFrame image_;
  CornerFrame corners_;
  std::optional<Instant> last_image_at_;
  std::optional<Instant> last_imu_at_;
  double imu_rate_hz_{0};
};

}  // namespace fiducap
