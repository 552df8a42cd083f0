#include "daemon/setup/setup_guide.hpp"

#include <algorithm>
#include <utility>

#include "base/text.hpp"
#include "base/yaml.hpp"
#include "capture/gray_image.hpp"
#include "capture/imu_sample.hpp"
#include "daemon/config/config_visitors.hpp"

namespace fiducap {
namespace {

constexpr double kSlow = 0.1;                          // weight of the newest in running means
constexpr Duration kSilent = std::chrono::seconds(2);  // without readings of the IMU
// Guess of an uncalibrated lens: 70 degrees wide, with these sigmas.
constexpr double kUsualHalfWidth = 0.7;  // tangent
constexpr double kGuessedFocal = 0.15;
constexpr double kGuessedCentre_px = 30;
constexpr double kGuessedK1 = 0.15;
constexpr double kLargestTag_m = 5;
// Sigmas of a pose measured by hand.
constexpr double kByHand_m = 0.02;
constexpr double kByHand_rad = 0.1;

/// Camera axes (x right, y down, z ahead) on a body whose x is forward, y left, z up.
Expected<Pose> pose_of_camera(const std::string& looks, const Eigen::Vector3d& p) {
  struct Facing {
    const char* word;
    Eigen::Vector3d right, down;
  };
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(),
                        z = Eigen::Vector3d::UnitZ();
  const std::array<Facing, 6> kFacings{{{"forward", -y, -z},
                                        {"back", y, -z},
                                        {"left", x, -z},
                                        {"right", -x, -z},
                                        {"up", -y, x},
                                        {"down", -y, -x}}};
  std::vector<std::string> words;
  for (const Facing& facing : kFacings) {
    words.emplace_back(facing.word);
    if (looks != facing.word) continue;
    Eigen::Matrix3d R_BV;
    R_BV << facing.right, facing.down, facing.right.cross(facing.down);
    return Pose{Eigen::Quaterniond(R_BV), p};
  }
  return fail(ErrorCode::kInvalid, must_be_one_of(words, looks), "looks = " + looks);
}

/// From the content of `imu_source` in a configuration.
Expected<ImuSourceConfig> imu_source_from(const std::string& text) {
  const auto document = load_yaml(text);
  if (!document) return fail(ErrorCode::kInvalid, document.error().text(), "the IMU");
  const auto reading = std::make_shared<YamlReading>(YamlReading{"the IMU"});
  ImuSourceConfig source;
  ConfigReader::read_all(YamlSection(*document, "", reading), source);
  auto faults = source.check("");
  if (!reading->faults.empty())
    return fail(ErrorCode::kInvalid, reading->faults.front().error.text(), "the IMU");
  if (!faults.empty()) return fail(ErrorCode::kInvalid, faults.front().text(), "the IMU");
  return source;
}

}  // namespace

struct SetupGuide::Entry {
  const char* word;
  Handler handle;
  std::vector<SetupStep> steps;  ///< In which it is allowed; empty: in all.
};

SetupGuide::SetupGuide(SetupRig& rig, std::function<void()> show)
    : rig_(rig), show_(std::move(show)), cameras_(rig.cameras()) {
  rig_.begin(step_);
}

Expected<void> SetupGuide::command(const SetupCommand& command) {
  using enum SetupStep;
  static const std::vector<Entry> kEntries{
      {"look", &SetupGuide::look_for_cameras, {kCamera}},
      {"camera", &SetupGuide::use_camera, {kCamera}},
      {"settings", &SetupGuide::set_camera, {kPicture}},
      {"sheet", &SetupGuide::set_sheet, {kSheet}},
      {"guess", &SetupGuide::keep_guess, {kLens}},
      {"imu", &SetupGuide::use_imu, {kImu}},
      {"mount", &SetupGuide::set_mount, {kMount}},
      {"again", &SetupGuide::again, {kLens, kRest, kWave}},
      {"next", &SetupGuide::next, {}},
      {"back", &SetupGuide::back, {}},
  };
  std::vector<std::string> words;
  for (const Entry& entry : kEntries) {
    words.emplace_back(entry.word);
    if (command.what != entry.word) continue;
    const auto& steps = entry.steps;
    if (!steps.empty() && std::ranges::find(steps, step_) == steps.end())
      return fail(ErrorCode::kInvalid, "does not belong to this step", command.what);
    auto done = (this->*entry.handle)(command);
    show_();
    return done;
  }
  return fail(ErrorCode::kInvalid, must_be_one_of(words, command.what), command.what);
}

// --- samples -------------------------------------------------------------------------------------

void SetupGuide::take(const SensorSample& sample) {
  if (const auto* imu = std::get_if<ImuSample>(&sample)) return take_imu(*imu);
  if (const auto* image = std::get_if<CameraFrame>(&sample)) take_image(*image);
}

void SetupGuide::take_imu(const ImuSample& sample) {
  if (last_imu_at_ && sample.sampled_at > *last_imu_at_) {
    const double rate = 1 / to_seconds(sample.sampled_at - *last_imu_at_);
    imu_rate_hz_ += (imu_rate_hz_ == 0 ? 1 : kSlow / 10) * (rate - imu_rate_hz_);
  }
  last_imu_at_ = sample.sampled_at;
  if (step_ == SetupStep::kRest && !verdict_) {
    rest_.take(sample);
    if (rest_.is_enough()) solve_rest();
  }
  if (step_ == SetupStep::kWave && !verdict_) wave_.take(sample);
}

void SetupGuide::take_image(const CameraFrame& frame) {
  image_ = frame;
  if (!detector_) detector_.emplace(result_.tags, DetectorConfig{});
  corners_ = detector_->detect(frame);
  judge_picture();
  if (last_imu_at_ && frame.exposed_at - *last_imu_at_ > kSilent) imu_rate_hz_ = 0;
  if (step_ == SetupStep::kLens) guide_lens();
  if (step_ != SetupStep::kWave || verdict_) return;
  wave_.take(corners_);
  if (wave_.progress().is_enough) solve_wave();
}

void SetupGuide::guide_lens() {
  if (verdict_ && verdict_->is_good) return;
  const GrayImage& image = *image_.image;
  if (!lens_) {
    CalibrationTargets targets;
    targets.tags = result_.tags;
    lens_.emplace(std::move(targets), image.width, image.height);
  }
  const bool is_kept = lens_->look(corners_);
  if (is_kept && lens_->progress().is_enough) solve_lens();
}

// --- commands ------------------------------------------------------------------------------------

Expected<void> SetupGuide::look_for_cameras(const SetupCommand&) {
  cameras_ = rig_.cameras();
  return {};
}

Expected<void> SetupGuide::use_camera(const SetupCommand& command) {
  CameraDeviceConfig device;
  device.open = command.text("open");
  device.width = static_cast<int>(command.number("width").value_or(0));
  device.height = static_cast<int>(command.number("height").value_or(0));
  device.rate_hz = command.number("rate_hz").value_or(0);
  if (const auto errors = device.check("camera."); !errors.empty())
    return fail(ErrorCode::kInvalid, errors.front().text());
  forget_images();
  if (auto used = rig_.use(device); !used) return used;
  // Identifies a camera with its lens model.
  const std::string now = device.open + " " + size_text(device.width, device.height);
  if (std::exchange(camera_in_use_, now) != now) forget_camera();
  result_.camera.source = CameraSourceConfig{};
  result_.camera.source->camera = device;
  result_.simulated = rig_.simulated();
  if (result_.simulated) result_.camera.source.reset();
  return {};
}

/// Another camera: discards all results for the former one.
void SetupGuide::forget_camera() {
  result_.camera = {};
  result_.lens_from.clear();
  result_.mount_from.clear();
  lens_.reset();
  if (!result_.simulated) return;
  result_.imu.reset();  // a part of it
  result_.imu_from.clear();
}

void SetupGuide::forget_lens() {
  const CameraMount unknown = CameraConfig{}.mount;
  CameraMount& mount = result_.camera.mount;
  mount.model = unknown.model;
  mount.focal_sigma = unknown.focal_sigma;
  mount.centre_sigma_px = unknown.centre_sigma_px;
  mount.k1_sigma = unknown.k1_sigma;
  mount.lens_error_px = unknown.lens_error_px;
  result_.lens_from.clear();
}

void SetupGuide::forget_clock() {
  const CameraMount unknown = CameraConfig{}.mount;
  result_.camera.mount.time_shift = unknown.time_shift;
  result_.camera.mount.time_shift_sigma_s = unknown.time_shift_sigma_s;
}

void SetupGuide::forget_images() {
  picture_.reset();
  image_ = {};
  corners_ = {};
  last_image_at_.reset();
}

Expected<void> SetupGuide::set_camera(const SetupCommand& command) {
  if (!result_.camera.source)
    return fail(ErrorCode::kInvalid, "a simulated camera has no settings: continue");
  CameraDeviceConfig device = result_.camera.source->camera;
  if (const auto exposure = command.number("exposure_ms")) device.exposure_s = *exposure * 1e-3;
  if (const auto errors = device.check("camera."); !errors.empty())
    return fail(ErrorCode::kInvalid, errors.front().text());
  forget_images();
  if (auto used = rig_.use(device); !used) return used;
  result_.camera.source->camera = device;
  return {};
}

/// The size on paper: printers scale, the ruler of the sheet shows the factor.
Expected<void> SetupGuide::set_sheet(const SetupCommand& command) {
  TagSetConfig tags = result_.tags;
  if (const std::string family = command.text("family"); !family.empty()) tags.family = family;
  const auto size_mm = command.number("size_mm");
  const double ruler_mm = command.number("ruler_mm").value_or(100);
  if (!size_mm || !(*size_mm > 0) || *size_mm >= 1e3 * kLargestTag_m)
    return fail(ErrorCode::kInvalid, "must be the edge of the black square in mm, e.g. 160",
                "size_mm = " + command.text("size_mm"));
  if (!(ruler_mm > 50) || !(ruler_mm < 200))
    return fail(ErrorCode::kInvalid,
                "must be the measured length of the printed 100 mm ruler, e.g. 99.4",
                "ruler_mm = " + command.text("ruler_mm"));
  tags.size_m = *size_mm * 1e-3 * ruler_mm / 100;
  if (const auto errors = tags.check(); !errors.empty())
    return fail(ErrorCode::kInvalid, errors.front().text());
  result_.tags = tags;
  detector_.reset();
  lens_.reset();
  return {};
}

/// An uncalibrated lens, estimated in motion.
Expected<void> SetupGuide::keep_guess(const SetupCommand&) {
  if (!image_.image) return fail(ErrorCode::kInvalid, "no image yet: its size is unknown");
  forget_lens();
  CameraMount& mount = result_.camera.mount;
  mount.model.width = image_.image->width;
  mount.model.height = image_.image->height;
  mount.model.fu = mount.model.fv = mount.model.width / 2.0 / kUsualHalfWidth;
  mount.model.cu = (mount.model.width - 1) / 2.0;
  mount.model.cv = (mount.model.height - 1) / 2.0;
  mount.model.distortion = Distortion::kRadialTangential;
  mount.focal_sigma = kGuessedFocal;
  mount.centre_sigma_px = kGuessedCentre_px;
  mount.k1_sigma = kGuessedK1;
  enter(SetupStep::kImu);
  return {};
}

Expected<void> SetupGuide::set_mount(const SetupCommand& command) {
  const auto x = command.number("x_m"), y = command.number("y_m"), z = command.number("z_m");
  const auto pose =
      pose_of_camera(command.text("looks"), {x.value_or(0), y.value_or(0), z.value_or(0)});
  if (!pose) return tl::unexpected(pose.error());
  result_.camera.mount.X_BV = *pose;
  result_.camera.mount.position_sigma_m = kByHand_m;
  result_.camera.mount.rotation_sigma_rad = kByHand_rad;
  result_.mount_from.clear();
  forget_clock();
  return {};
}

/// `source` as in a configuration, and the `part` if known.
Expected<void> SetupGuide::use_imu(const SetupCommand& command) {
  forget_clock();  // was relative to the IMU before
  imu_rate_hz_ = 0;
  last_imu_at_.reset();
  if (command.text("source").empty()) {
    rig_.close_imu();
    result_.imu_source.reset();
    result_.imu.reset();
    return {};
  }
  auto source = imu_source_from(command.text("source"));
  if (!source) return tl::unexpected(source.error());
  if (auto used = rig_.use(*source); !used) return used;
  result_.imu_source = std::move(*source);
  result_.imu = noise_of_part(command.text("part"), ImuNoise{}.rate_hz).value_or(ImuNoise{});
  result_.imu_from = command.text("part").empty() ? "" : "data sheet of " + command.text("part");
  return {};
}

// --- the steps -----------------------------------------------------------------------------------

std::optional<std::string> SetupGuide::missing() const {
  const CameraModel& lens = result_.camera.mount.model;
  const GrayImage* image = image_.image.get();
  if (step_ == SetupStep::kCamera && image == nullptr) return "no image yet: choose a camera";
  if (step_ == SetupStep::kPicture && image == nullptr)
    return "no images: check the camera's cable, or choose it again";
  if (step_ == SetupStep::kLens && lens.width == 0)
    return "the lens is not known yet: continue with the images, or use a guess";
  if (step_ == SetupStep::kLens && image != nullptr &&
      (image->width != lens.width || image->height != lens.height))
    return "the lens is known for images of another size: repeat it, or use a guess";
  if (step_ == SetupStep::kImu && result_.imu && imu_rate_hz_ == 0)
    return "no readings from the IMU: check its cable and settings, or continue without";
  return std::nullopt;
}

bool SetupGuide::is_left_out(SetupStep step) const {
  return (step == SetupStep::kRest || step == SetupStep::kWave) && !result_.imu;
}

bool SetupGuide::is_skipped(SetupStep step) const {
  if (step >= step_ || is_left_out(step)) return false;
  return (step == SetupStep::kLens && result_.lens_from.empty()) ||
         (step == SetupStep::kRest && !result_.imu_from.starts_with(kMeasuredAtRest)) ||
         (step == SetupStep::kWave && result_.mount_from.empty());
}

Expected<void> SetupGuide::next(const SetupCommand&) {
  if (const auto what = missing()) return fail(ErrorCode::kInvalid, *what);
  enter(neighbour(1));
  return {};
}

Expected<void> SetupGuide::back(const SetupCommand&) {
  enter(neighbour(-1));
  return {};
}

/// The nearest step in this direction that is not left out; at the ends: the same.
SetupStep SetupGuide::neighbour(int direction) const {
  SetupStep step = step_;
  do
    step = static_cast<SetupStep>(
        std::clamp(static_cast<int>(step) + direction, 0, static_cast<int>(SetupStep::kFinish)));
  while (is_left_out(step));
  return step;
}

Expected<void> SetupGuide::again(const SetupCommand&) {
  begin_step();
  return {};
}

void SetupGuide::enter(SetupStep step) {
  step_ = step;
  if (step == SetupStep::kImu && result_.simulated && !result_.imu) {
    result_.imu = result_.simulated->imu.noise;
    result_.imu_from = "as simulated";
  }
  begin_step();
  rig_.begin(step);
}

void SetupGuide::begin_step() {
  verdict_.reset();
  if (step_ == SetupStep::kLens) lens_.reset();
  if (step_ == SetupStep::kRest) rest_ = RestGuide();
  if (step_ == SetupStep::kWave) wave_ = WaveGuide();
}

}  // namespace fiducap
