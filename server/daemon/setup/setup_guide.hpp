#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "calibration/guided/lens_guide.hpp"
#include "calibration/guided/rest_guide.hpp"
#include "calibration/guided/wave_guide.hpp"
#include "daemon/setup/setup_result.hpp"
#include "daemon/setup/setup_rig.hpp"
#include "detection/image_measures.hpp"
#include "detection/tag_detector.hpp"

namespace fiducap {

/// What a person asks for: a word and what belongs to it, e.g. `camera` with `open`.
struct SetupCommand {
  std::string what;
  std::map<std::string, std::string> values{};

  [[nodiscard]] std::string text(const std::string& key) const;
  /// @return nullopt: not there, or no number
  [[nodiscard]] std::optional<double> number(const std::string& key) const;
};

/// What the camera shows, for people.
struct SetupPicture {
  int width{};
  int height{};
  double rate_hz{};
  ImageMeasures measures;
  ImageBlur blur;
  std::size_t tags{};
  std::string verdict;  ///< A sentence: what to do about it, or that it is well.
  bool is_good{};
};

/// The outcome of something that was solved for.
struct SetupVerdict {
  bool is_good{};
  bool is_refused{};  ///< It must not be used.
  std::string summary{};
  std::vector<std::string> advice{};
};

/// Leads a person through the steps of a set-up, one after the other, and keeps what was found out.
/// No threads, no clock: it is given samples and commands by one thread. What takes long (solving)
/// is done within take(); `show` is called before, so that people see that it goes on.
class SetupGuide final {
 public:
  /// @param show  what changed can be shown now
  SetupGuide(SetupRig& rig, std::function<void()> show);

  void take(const SensorSample& sample);
  /// @return Error saying what was expected: not in this step, a value that is none
  Expected<void> command(const SetupCommand& command);

  [[nodiscard]] SetupStep step() const { return step_; }
  [[nodiscard]] const SetupResult& result() const { return result_; }
  [[nodiscard]] const std::vector<FoundCamera>& cameras() const { return cameras_; }
  [[nodiscard]] const std::optional<SetupPicture>& picture() const { return picture_; }
  [[nodiscard]] const LensGuide* lens() const { return lens_ ? &*lens_ : nullptr; }
  [[nodiscard]] const RestGuide& rest() const { return rest_; }
  [[nodiscard]] const WaveGuide& wave() const { return wave_; }
  /// Of this step; nullopt: nothing was solved for yet.
  [[nodiscard]] const std::optional<SetupVerdict>& verdict() const { return verdict_; }
  [[nodiscard]] bool is_solving() const { return is_solving_; }
  /// The newest image and what was seen in it.
  [[nodiscard]] const CameraFrame& image() const { return image_; }
  [[nodiscard]] const CornerFrame& corners() const { return corners_; }
  /// Readings of the IMU a second, 0: none come.
  [[nodiscard]] double imu_rate_hz() const { return imu_rate_hz_; }

 private:
  using Handler = Expected<void> (SetupGuide::*)(const SetupCommand&);
  struct Entry;

  void take_image(const CameraFrame& frame);
  void take_imu(const ImuSample& sample);
  void judge_picture();
  void guide_lens();
  void guide_wave();
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
  [[nodiscard]] std::optional<std::string> missing() const;
  void enter(SetupStep step);
  void begin_step();
  [[nodiscard]] bool is_left_out(SetupStep step) const;

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
