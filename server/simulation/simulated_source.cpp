#include <cmath>
#include <utility>

#include "detection/tag_family.hpp"
#include "simulation/images/image_camera.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/sensor_models.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

namespace {

// Exposures do not coincide with IMU samples, as with a real camera.
constexpr Duration kFirstExposure = std::chrono::microseconds(1300);
constexpr int kImu = -1;

// Further behind the clock no image is drawn.
constexpr Duration kMostBehind = std::chrono::milliseconds(50);
// Ordinary delay of a thread that wakes.
constexpr Duration kWakeDelay = std::chrono::milliseconds(5);

/// The sample that a sensor delivers next.
struct Pending {
  int sensor{kImu};  ///< kImu or the camera's index.
  double rate_hz{};
  Duration first{0};
  std::uint64_t k{0};
  Duration taken{0};    ///< Time of the sample after the start.
  Duration arrives{0};  ///< Time of its delivery after the start; never decreases.
};

class Simulation final : public SimulatedSource {
 public:
  Simulation(const RoomConfig& room, const SimulatedBodyConfig& body,
             std::unique_ptr<Trajectory> trajectory, int ids, Instant start, const Clock* clock)
      : body_(body),
        tags_(tags_of(room)),
        trajectory_(std::move(trajectory)),
        imu_(body.imu, room.gravity_m_s2, body.seed),
        faults_(body.faults, ids, body.seed),
        start_(start),
        clock_(clock) {
    if (body_.has_imu) pending_.push_back({kImu, body_.imu.noise.rate_hz});
    for (std::size_t i = 0; i < body_.cameras.size(); ++i) {
      pending_.push_back({static_cast<int>(i), body_.cameras[i].rate_hz, kFirstExposure});
      if (body_.camera.images) add_image_camera(room, body_.cameras[i]);
    }
    for (Pending& sensor : pending_) schedule(sensor, 0);
  }

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      Pending& first = first_to_arrive();
      if (ended(first)) return std::nullopt;
      if (clock_ != nullptr && first.sensor == kImu && !is_behind(first, kMostBehind)) draw_ahead();
      if (clock_ != nullptr && !clock_->wait_until(start_ + first.arrives, stop))
        return std::nullopt;
      const Pending now = first;
      schedule(first, now.k + 1);
      if (now.sensor != kImu && is_too_late_to_draw(now)) continue;
      if (!dropped(now)) return std::optional<SensorSample>(take(now));
    }
    return std::nullopt;
  }

  [[nodiscard]] TruthSample truth(Instant at) const override {
    const double t_s = to_seconds(at - start_);
    const Trajectory::Point point = trajectory_->at(t_s);
    const ImuBias bias = imu_.bias_at(t_s);
    return {at, point.X_WB, point.v_WB, bias.w, bias.f};
  }

  [[nodiscard]] Instant start() const override { return start_; }

  [[nodiscard]] const std::vector<CameraMount>& cameras() const override { return body_.cameras; }

 private:
  /// With equal times the IMU comes first, then the cameras by index.
  [[nodiscard]] Pending& first_to_arrive() {
    Pending* first = &pending_.front();
    for (Pending& sensor : pending_)
      if (sensor.arrives < first->arrives) first = &sensor;
    return *first;
  }

  /// A busy machine drops images, as a camera with full buffers does, but no IMU samples.
  [[nodiscard]] bool is_too_late_to_draw(const Pending& sample) const {
    if (images_.empty() || !is_behind(sample, kWakeDelay)) return false;
    // Most of an image is drawn between IMU samples if there is time.
    const auto camera = static_cast<std::size_t>(sample.sensor);
    const bool mostly_drawn =
        images_[camera].begun == sample.k &&
        images_[camera].renderer->rows_left() < body_.cameras[camera].model.height / 2;
    return !mostly_drawn || is_behind(sample, kMostBehind);
  }

  [[nodiscard]] bool is_behind(const Pending& sample, Duration by) const {
    return clock_ != nullptr && clock_->now() > start_ + sample.arrives + by;
  }

  [[nodiscard]] bool ended(const Pending& sample) const {
    return body_.trajectory.duration_s > 0 &&
           to_seconds(sample.taken) > body_.trajectory.duration_s;
  }

  void schedule(Pending& sensor, std::uint64_t k) const {
    sensor.k = k;
    sensor.taken =
        sensor.first + Duration{std::llround(static_cast<double>(k) * 1e9 / sensor.rate_hz)};
    const Duration late = sensor.sensor == kImu ? faults_.imu_delay(k)
                                                : from_seconds(body_.camera.latency_s) +
                                                      faults_.image_delay(sensor.sensor, k);
    sensor.arrives = std::max(sensor.arrives, sensor.taken + late);
    if (ended(sensor)) sensor.arrives = Duration::max();
  }

  [[nodiscard]] bool dropped(const Pending& sample) const {
    return sample.sensor == kImu
               ? faults_.drops_imu(sample.k)
               : faults_.drops_image(sample.sensor, sample.k, to_seconds(sample.taken));
  }

  [[nodiscard]] SensorSample take(const Pending& sample) {
    const double t_s = to_seconds(sample.taken);
    if (sample.sensor == kImu) {
      ImuSample imu = imu_.measure(sample.k, trajectory_->at(t_s));
      faults_.saturate(t_s, imu);
      imu.sampled_at = start_ + sample.taken + faults_.imu_stamp_error(sample.k, sample.rate_hz);
      return imu;
    }
    const auto camera = static_cast<std::size_t>(sample.sensor);
    const Instant stamp = start_ + sample.taken + faults_.image_stamp_error();
    if (!images_.empty()) {
      begin_image(sample);
      images_[camera].renderer->draw(body_.cameras[camera].model.height);
      return CameraFrame{sample.sensor, stamp, images_[camera].renderer->take()};
    }
    const CameraMount& mount = body_.cameras[camera];
    set_frame_tags(sample);
    CornerFrame frame{sample.sensor, stamp, {}};
    const auto camera_at = [&](double row) {
      return trajectory_->at(t_s + row * mount.readout_s).X_WB * mount.X_BV;
    };
    sight_corners(mount.model, camera_at, frame_tags_, body_.camera, key_of(sample), frame.tags);
    faults_.cover_corners(sample.sensor, sample.k, frame.tags);
    return frame;
  }

  [[nodiscard]] ImageKey key_of(const Pending& sample) const {
    return {body_.seed, sample.sensor, sample.k};
  }

  /// Sets the tags as they are, or are reported, in this image.
  void set_frame_tags(const Pending& sample) {
    frame_tags_ = tags_;
    faults_.change_tags(sample.sensor, sample.k, to_seconds(sample.taken), frame_tags_);
  }

  struct DrawnCamera {
    std::unique_ptr<ImageCamera> renderer;
    std::optional<std::uint64_t> begun;
  };

  void add_image_camera(const RoomConfig& room, const CameraMount& mount) {
    auto family = TagFamily::named(room.family);
    images_.push_back(
        {std::make_unique<ImageCamera>(mount, body_.camera, RoomLook{box_of(room), room.texture},
                                       std::move(*family), room.daylight),
         {}});
    constexpr double kReserve = 1.25;
    rows_ahead_ += 1 + static_cast<int>(kReserve * mount.model.height * mount.rate_hz /
                                        body_.imu.noise.rate_hz);
  }

  void begin_image(const Pending& sample) {
    DrawnCamera& camera = images_[static_cast<std::size_t>(sample.sensor)];
    if (camera.begun == sample.k) return;
    camera.begun = sample.k;
    set_frame_tags(sample);
    camera.renderer->begin(key_of(sample), *trajectory_, to_seconds(sample.taken), frame_tags_);
  }

  /// Draws a slice of the next image between two IMU samples, so that none waits for a whole image.
  void draw_ahead() {
    int rows = rows_ahead_;
    for (std::size_t i = 0; i < images_.size() && rows > 0; ++i) {
      const Pending& image = pending_[i + 1];  // the IMU is the first
      if (ended(image) || dropped(image)) continue;
      begin_image(image);
      const int left = images_[i].renderer->rows_left();
      images_[i].renderer->draw(rows);
      rows -= left;
    }
  }

  SimulatedBodyConfig body_;
  std::vector<RecordedTag> tags_;
  std::unique_ptr<Trajectory> trajectory_;
  ImuModel imu_;
  Faults faults_;
  Instant start_;
  const Clock* clock_;
  std::vector<Pending> pending_;
  std::vector<RecordedTag> frame_tags_;  ///< Reuses its memory.
  std::vector<DrawnCamera> images_;      ///< Empty without images.
  int rows_ahead_{0};
};

}  // namespace

Expected<std::unique_ptr<SimulatedSource>> make_simulated_source(
    const RoomConfig& room, const SimulatedBodyConfig& body, Instant start, const Clock* clock,
    std::unique_ptr<Trajectory> motion) {
  std::vector<ConfigError> errors = check(room, "room.");
  const std::vector<ConfigError> body_errors = check(body, "body.");
  errors.insert(errors.end(), body_errors.begin(), body_errors.end());
  if (!errors.empty()) return fail(ErrorCode::kInvalid, errors.front().text(), "simulation");
  const Pose X_BV = body.cameras.empty() ? forward_camera() : body.cameras.front().X_BV;
  if (!motion) {
    auto trajectory = make_trajectory(body.trajectory, room, X_BV);
    if (!trajectory) return tl::unexpected(trajectory.error());
    motion = std::move(*trajectory);
  }
  const int ids = TagFamily::named(room.family)->ids();
  return std::make_unique<Simulation>(room, body, std::move(motion), ids, start, clock);
}

}  // namespace fiducap::simulation
