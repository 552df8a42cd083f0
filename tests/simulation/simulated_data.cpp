#include <algorithm>
#include <functional>
#include <random>

#include <Eigen/Dense>

#include "base/pose.hpp"
#include "capture/sample_merger.hpp"
#include "detection/points/point_tracker.hpp"
#include "detection/tag_search.hpp"
#include "pipeline/body_pipeline.hpp"
#include "simulation/estimation_data.hpp"
#include "simulation/room_shape.hpp"
#include "support/results.hpp"

namespace fiducap {

namespace {

constexpr double kPredicted_px = 2.0;  // about the error of a filter's prediction
// Corner noise of sharp, rendered images in config/demo.yaml.
constexpr double kRenderedNoise_px = 0.15;
constexpr Instant kFirstSample = instant_from_ns(1'000'000'000);

CameraMount simulated_camera(const SimulatedDataSetup& setup) {
  CameraMount mount = forward_mount();
  if (!setup.images_for.empty() || setup.lens_error_px > 0) {
    // A VI-Sensor's left camera: barrel distortion of 60 px in the image corner, 6 cm off the IMU.
    mount.model.distortion = Distortion::kRadialTangential;
    mount.model.coefficients = {-0.28, 0.07, 2e-4, 2e-5, 0};
    mount.X_BV.p = {0.01, 0.057, -0.012};
  }
  mount.readout_s = setup.readout_s;
  mount.position_sigma_m = setup.extrinsics_sigma_m;
  mount.rotation_sigma_rad = setup.extrinsics_sigma_rad;
  return mount;
}

/// Tags and followed points of rendered images, found as the server finds them, but led by the
/// truth instead of a filter: so that several filters can be run over the same sightings.
class RenderedCorners final {
 public:
  RenderedCorners(const simulation::RoomConfig& room, const CameraMount& camera)
      : camera_(camera),
        tags_(simulation::tags_of(room)),
        search_(TagSetConfig{.family = room.family}, {}) {}

  [[nodiscard]] CornerFrame look(const CameraFrame& image,
                                 const simulation::SimulatedSource& source) {
    const Pose X_WV = source.truth(image.exposed_at).X_WB * camera_.X_BV;
    expect(X_WV);
    CornerFrame found = search_.search(image, expected_);
    std::optional<Eigen::Quaterniond> turn;
    if (q_before_) turn = q_before_->conjugate() * X_WV.q;
    q_before_ = X_WV.q;
    const auto points = points_.follow(image, camera_.model, turn, found.tags);
    found.points.assign(points.begin(), points.end());
    return found;
  }

 private:
  void expect(const Pose& X_WV) {
    expected_.clear();
    const Pose X_VW = X_WV.inverse();
    for (const RecordedTag& tag : tags_) {
      const Eigen::Vector3d p = X_VW * tag.X_WT.p;
      const Eigen::Vector3d normal = X_VW.q * (tag.X_WT.q * Eigen::Vector3d::UnitZ());
      if (p.z() < 0.05 || -normal.dot(p) < 0.17 * p.norm()) continue;
      ExpectedTag expected{tag.tag_id, {}, kPredicted_px};
      const auto corners = simulation::corners_of(tag);
      bool inside = true;
      for (std::size_t i = 0; i < 4 && inside; ++i) {
        const auto px = camera_.model.project(X_VW * corners[i]);
        inside = px && px->x() > 0 && px->y() > 0 && px->x() < camera_.model.width - 1 &&
                 px->y() < camera_.model.height - 1;
        if (inside) expected.corners_px[i] = *px;
      }
      if (inside) expected_.push_back(expected);
    }
  }

  CameraMount camera_;
  std::vector<RecordedTag> tags_;
  TagSearch search_;
  PointTracker points_;
  std::vector<ExpectedTag> expected_;
  std::optional<Eigen::Quaterniond> q_before_;
};

/// The samples of a source up to an instant, images replaced by the corners that a body's own
/// pipeline finds in them, led by its filter.
std::vector<SensorSample> found_by(const PipelineSetup& setup, SensorSource& source, Instant end) {
  BodyPipeline pipeline(setup);
  const MapView empty{std::make_shared<const TagMap>()};
  std::vector<SensorSample> out;
  for (bool more = true; more;) {
    auto sample = value_of(source.next({}));
    more = sample && time_of(*sample) <= end;
    if (more) {
      pipeline.push(std::move(*sample));
    } else {
      pipeline.finish();
    }
    while (const SensorSample* next = pipeline.next()) {
      if (const auto* imu = std::get_if<ImuSample>(next)) out.emplace_back(*imu);
      if (const BodyUpdate* update = pipeline.take(empty)) out.emplace_back(update->corners);
    }
  }
  return out;
}

std::string motion_in(const std::string& world) {
  if (world == "hall") return "survey";
  if (world == "big") return "ceiling";
  return world == "pavillon" || world == "ring" ? "loop" : world;
}

ImuNoise scaled(ImuNoise noise, double factor) {
  noise.gyro_noise_rad_s_rtHz *= factor;
  noise.gyro_walk_rad_s2_rtHz *= factor;
  noise.accel_noise_m_s2_rtHz *= factor;
  noise.accel_walk_m_s3_rtHz *= factor;
  return noise;
}

/// Fills in the samples. @pre everything that a filter must know is there
void collect(EstimationData& data, const SimulatedDataSetup& setup,
             const simulation::RoomConfig& room, simulation::SimulatedSource& source) {
  const Instant end = kFirstSample + from_seconds(setup.seconds);
  if (!setup.texture.empty()) {
    RenderedCorners rendered(room, data.camera);
    data.samples = merged(source, setup.has_imu, end, [&](const SensorSample& sample) {
      const auto* image = std::get_if<CameraFrame>(&sample);
      return image == nullptr ? sample : SensorSample(rendered.look(*image, source));
    });
    data.corner_noise_px = kRenderedNoise_px;
    return;
  }
  if (setup.images_for.empty()) {
    data.samples = merged(source, setup.has_imu, end);
    data.corner_noise_px = simulation::CameraSimulation{}.corner_noise_px;
    return;
  }
  PipelineSetup pipeline;
  pipeline.filter = setup.images_for;
  pipeline.sensors = {{data.camera}, data.imu, data.gravity_m_s2};
  pipeline.sensors.cameras.front().X_BV = data.nominal_X_BV;
  pipeline.tags = data.tag_set;
  data.samples = found_by(pipeline, source, end);
  data.corner_noise_px = EstimatorConfig{}.corner_noise_px;  // default of a server
}

/// True states at all samples, and at the IMU's rate where samples are missing or have wrong
/// stamps, and past the last image.
std::vector<TruthSample> true_states(const EstimationData& data,
                                     const simulation::SimulatedSource& source, double seconds,
                                     double rate_hz) {
  std::vector<Instant> times;
  for (const SensorSample& sample : data.samples) times.push_back(time_of(sample));
  const double period_s = 1 / rate_hz;
  for (double t_s = 0; t_s <= seconds + period_s; t_s += period_s)
    times.push_back(kFirstSample + from_seconds(t_s));
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  std::vector<TruthSample> states;
  for (const Instant at : times) states.push_back(source.truth(at));
  return states;
}

// --- lenses as a calibration leaves them ---

constexpr int kNumbers = 8;  // fu fv cu cv k1 k2 p1 p2
constexpr int kSteps = 7;    // of the grid, each way
constexpr double kWide = 0.75;
constexpr double kHigh = 0.48;
constexpr double kSmall = 1e-6;
constexpr double kSharpCorner_px = 0.03;
// Sigmas of single parameters, for a pixel of error all over the image.
constexpr double kFocalPerPx = 0.02;
constexpr double kCentrePerPx = 10;
constexpr double kBendPerPx = 0.01;

std::vector<Eigen::Vector3d> ray_grid() {
  std::vector<Eigen::Vector3d> rays;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j)
      rays.emplace_back(kWide * (2.0 * i / (kSteps - 1) - 1), kHigh * (2.0 * j / (kSteps - 1) - 1),
                        1);
  return rays;
}

Eigen::VectorXd projected(const CameraModel& lens, const Eigen::Matrix3d& turn) {
  const std::vector<Eigen::Vector3d> rays = ray_grid();
  Eigen::VectorXd out(2 * static_cast<Eigen::Index>(rays.size()));
  for (std::size_t i = 0; i < rays.size(); ++i)
    out.segment<2>(2 * static_cast<Eigen::Index>(i)) = lens.project(turn * rays[i]).value();
  return out;
}

CameraModel changed_lens(CameraModel lens, const Eigen::VectorXd& by) {
  lens.fu += by(0);
  lens.fv += by(1);
  lens.cu += by(2);
  lens.cv += by(3);
  for (std::size_t k = 0; k < 4; ++k) lens.coefficients[k] += by(4 + static_cast<Eigen::Index>(k));
  return lens;
}

/// @see with_calibrated_lens
CameraModel calibrated_lens(const CameraModel& lens, double rms_px, std::uint64_t seed) {
  const Eigen::VectorXd true_px = projected(lens, Eigen::Matrix3d::Identity());
  Eigen::MatrixXd turns(true_px.size(), 3);
  for (int axis = 0; axis < 3; ++axis)
    turns.col(axis) =
        (projected(lens, exp_so3(kSmall * Eigen::Vector3d::Unit(axis)).toRotationMatrix()) -
         true_px) /
        kSmall;
  const auto of_pictures = [&](const Eigen::VectorXd& by) {
    const Eigen::VectorXd off =
        projected(changed_lens(lens, by), Eigen::Matrix3d::Identity()) - true_px;
    const Eigen::VectorXd rest = off - turns * turns.colPivHouseholderQr().solve(off);
    return std::sqrt(rest.squaredNorm() / static_cast<double>(rest.size()));
  };
  std::mt19937_64 random(seed * 977 + 3);
  std::normal_distribution<double> gauss;
  Eigen::VectorXd by(kNumbers);
  for (int k = 0; k < kNumbers; ++k) {
    const Eigen::VectorXd unit = kSmall * Eigen::VectorXd::Unit(kNumbers, k);
    by(k) = gauss(random) * kSmall / of_pictures(unit);
  }
  const double scale = rms_px / (of_pictures(kSmall * by) / kSmall);
  return changed_lens(lens, scale * by);
}

}  // namespace

CameraMount forward_mount() {
  CameraMount mount;
  mount.model = {752, 480, 460, 460, 376, 240, Distortion::kNone, {}};
  mount.X_BV = simulation::forward_camera();
  return mount;
}

Pose drawn_extrinsics(const CameraMount& mount, std::uint64_t seed) {
  std::mt19937_64 random(seed * 77 + 5);
  std::normal_distribution<double> gauss;
  const auto draw = [&](double sigma) {
    const double x = gauss(random);
    const double y = gauss(random);
    return Eigen::Vector3d(sigma * Eigen::Vector3d(x, y, gauss(random)));
  };
  Pose X_BV = mount.X_BV;
  X_BV.p += draw(mount.position_sigma_m);
  X_BV.q = exp_so3(draw(mount.rotation_sigma_rad)) * X_BV.q;
  return X_BV;
}

EstimationData simulate(const SimulatedDataSetup& setup) {
  simulation::RoomConfig room;
  room.preset = setup.world == "big" ? "ceiling" : setup.world == "hover" ? "hall" : setup.world;
  room.daylight = setup.daylight;
  room.ring = setup.ring;
  room.gravity_m_s2 = setup.gravity_m_s2;
  simulation::SimulatedBodyConfig body;
  body.cameras = {simulated_camera(setup)};
  body.has_imu = setup.has_imu;
  body.camera.images = !setup.images_for.empty() || !setup.texture.empty();
  body.camera.exposure_s = setup.exposure_s;
  body.camera.corner_noise_px = setup.corner_noise_px;
  body.trajectory.kind = motion_in(setup.world);
  if (!setup.texture.empty()) room.texture = setup.texture;
  body.trajectory.seed = setup.seed;
  body.trajectory.speed = setup.speed;
  body.trajectory.duration_s = 0;
  body.trajectory.from = setup.from;
  body.trajectory.share = setup.share;
  body.faults = setup.faults;
  body.seed = setup.seed;
  const ImuNoise configured = body.imu.noise;
  body.imu.noise = scaled(configured, setup.imu_noise_factor);
  body.imu.gyro_gain = setup.gyro_gain;
  body.imu.accel_gain = setup.accel_gain;
  const auto source =
      value_of(simulation::make_simulated_source(room, body, kFirstSample, nullptr));

  EstimationData data;
  data.name = setup.world + " " + std::to_string(setup.seed);
  data.tags = simulation::tags_of(room);
  data.tag_set.family = room.family;
  for (const RecordedTag& tag : data.tags) data.tag_set.sizes_m[tag.tag_id] = tag.edge_m;
  data.camera = body.cameras.front();
  data.camera.readout_s = setup.readout_configured_s;
  data.camera.readout_sigma_s = setup.readout_sigma_s;
  data.nominal_X_BV = drawn_extrinsics(data.camera, setup.seed);
  if (setup.lens_error_px > 0)
    data.camera.model = calibrated_lens(data.camera.model, setup.lens_error_px, setup.seed);
  if (setup.has_imu) data.imu = configured;
  collect(data, setup, room, *source);
  data.reference_tag = first_tag(data);

  data.truth = true_states(data, *source, setup.seconds, body.imu.noise.rate_hz);
  return data;
}

EstimationData with_calibrated_lens(SimulatedDataSetup setup, double error_px,
                                    double configured_px) {
  setup.lens_error_px = error_px;
  setup.corner_noise_px = kSharpCorner_px;
  EstimationData data = simulate(setup);
  data.camera.lens_error_px = configured_px;
  data.camera.focal_sigma = kFocalPerPx * configured_px;
  data.camera.centre_sigma_px = kCentrePerPx * configured_px;
  data.camera.k1_sigma = kBendPerPx * configured_px;
  return data;
}

}  // namespace fiducap
