#include "simulation/estimation_data.hpp"

#include <algorithm>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <stdexcept>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "capture/sample_merger.hpp"
#include "daemon/system.hpp"
#include "pipeline/body_pipeline.hpp"
#include "simulation/rendered_corners.hpp"
#include "simulation/told_lens.hpp"

namespace fiducap {

namespace {

// Corner noise of sharp, rendered images in config/demo.yaml.
constexpr double kRenderedNoise_px = 0.15;
constexpr Instant kStart = instant_from_ns(1'000'000'000);

CameraMount simulated_camera(const SimulatedDataSetup& setup) {
  CameraMount mount;
  mount.model.width = 752;
  mount.model.height = 480;
  mount.model.fu = mount.model.fv = 460;
  mount.model.cu = 376;
  mount.model.cv = 240;
  mount.X_BV = simulation::forward_camera();
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

/// As the camera is, looking along x, -x, y and -y in turn, 10 cm from the middle of the body.
std::vector<CameraMount> simulated_rig(const SimulatedDataSetup& setup) {
  constexpr double kRadius_m = 0.1;
  const CameraMount first = simulated_camera(setup);
  std::vector<CameraMount> rig{first};
  for (const double turn : {std::numbers::pi, 0.5 * std::numbers::pi, -0.5 * std::numbers::pi}) {
    if (static_cast<int>(rig.size()) >= setup.cameras) break;
    CameraMount mount = first;
    const Eigen::Quaterniond q = exp_so3({0, 0, turn});
    mount.X_BV.q = q * first.X_BV.q;
    mount.X_BV.p = first.X_BV.p + kRadius_m * (q * Eigen::Vector3d::UnitX());
    rig.push_back(mount);
  }
  return rig;
}

/// The configured lens.
CameraModel drawn_lens(CameraModel lens, const SimulatedDataSetup& setup, std::uint64_t camera) {
  std::mt19937_64 random(setup.seed * 131 + camera);
  std::normal_distribution<double> gauss;
  const double longer = 1 + setup.focal_error * gauss(random);
  lens.fu *= longer;
  lens.fv *= longer;
  lens.cu += setup.centre_error_px * gauss(random);
  lens.cv += setup.centre_error_px * gauss(random);
  return setup.lens_error_px > 0 ? told_lens(lens, setup.lens_error_px, setup.seed + camera) : lens;
}

/// All samples of a source up to an instant, in the order of SampleMerger.
/// @param make  what becomes of a sample, of an image corners above all; nullptr: it stays as it is
std::vector<SensorSample> merged(
    SensorSource& source, bool has_imu, Instant end,
    const std::function<SensorSample(const SensorSample&)>& make = nullptr) {
  std::vector<SensorSample> out;
  SampleMerger merger(MergerConfig{.has_imu = has_imu});
  const auto drain = [&] {
    while (auto sample = merger.pop()) out.push_back(make ? make(*sample) : std::move(*sample));
  };
  for (;;) {
    auto sample = source.next({});
    if (!sample) throw std::runtime_error(sample.error().text());
    if (!sample->has_value() || time_of(**sample) > end) break;
    merger.push(std::move(**sample));
    drain();
  }
  merger.finish();
  drain();
  return out;
}

/// The samples of a source up to an instant, images replaced by the corners that a body's own
/// pipeline finds in them, led by its filter.
std::vector<SensorSample> found_by(const PipelineSetup& setup, SensorSource& source, Instant end) {
  BodyPipeline pipeline(setup);
  const MapView empty{std::make_shared<const TagMap>()};
  std::vector<SensorSample> out;
  for (bool more = true; more;) {
    auto sample = source.next({});
    if (!sample) throw std::runtime_error(sample.error().text());
    more = sample->has_value() && time_of(**sample) <= end;
    if (more) {
      pipeline.push(std::move(**sample));
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

/// Between two true states: cubic in position (by both velocities) and in attitude (by both rates,
/// B axes).
TruthSample between(const TruthSample& a, const TruthSample& b, const Eigen::Vector3d& w_a,
                    const Eigen::Vector3d& w_b, Instant at) {
  const double h = to_seconds(b.at - a.at);
  const double s = to_seconds(at - a.at) / h;
  // Hermite's cubic from zero: its end value and both slopes times h.
  const double end = s * s * (3 - 2 * s);
  const double slope_a = s * (1 - s) * (1 - s);
  const double slope_b = -s * s * (1 - s);
  const auto cubic = [&](const Eigen::Vector3d& to, const Eigen::Vector3d& da,
                         const Eigen::Vector3d& db) {
    return Eigen::Vector3d(end * to + slope_a * h * da + slope_b * h * db);
  };
  const auto mean = [&](const Eigen::Vector3d& x, const Eigen::Vector3d& y) {
    return Eigen::Vector3d((1 - s) * x + s * y);
  };
  TruthSample out;
  out.at = at;
  out.X_WB.p = a.X_WB.p + cubic(b.X_WB.p - a.X_WB.p, a.v_WB, b.v_WB);
  out.X_WB.q =
      (a.X_WB.q * exp_so3(cubic(log_so3(a.X_WB.q.conjugate() * b.X_WB.q), w_a, w_b))).normalized();
  out.v_WB = mean(a.v_WB, b.v_WB);
  out.bias_w = mean(a.bias_w, b.bias_w);
  out.bias_f = mean(a.bias_f, b.bias_f);
  return out;
}

/// Adds the instants of the images to a truth that has only those of the IMU.
void add_image_times(EstimationData& data) {
  std::vector<TruthSample> added;
  for (const SensorSample& sample : data.samples) {
    const Instant at = time_of(sample);
    const auto after = std::lower_bound(data.truth.begin(), data.truth.end(), at,
                                        [](const TruthSample& t, Instant i) { return t.at < i; });
    if (after == data.truth.begin() || after == data.truth.end() || after->at == at) continue;
    const auto before = after - 1;
    added.push_back(
        between(*before, *after, data.rate_at(before->at), data.rate_at(after->at), at));
  }
  data.truth.insert(data.truth.end(), added.begin(), added.end());
  std::sort(data.truth.begin(), data.truth.end(),
            [](const TruthSample& a, const TruthSample& b) { return a.at < b.at; });
}

/// The lowest id of the first image that shows a tag.
int first_tag(const EstimationData& data) {
  for (const SensorSample& sample : data.samples) {
    const auto* image = std::get_if<CornerFrame>(&sample);
    if (image == nullptr) continue;
    for (const TagSighting& seen : image->tags) {
      if (data.tag(seen.tag_id) != nullptr) return seen.tag_id;
    }
  }
  throw std::runtime_error(data.name + " shows no tag");
}

void set_sizes(EstimationData& data) {
  for (const RecordedTag& tag : data.tags) data.tag_set.sizes_m[tag.tag_id] = tag.edge_m;
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
  const Instant end = kStart + from_seconds(setup.seconds);
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

}  // namespace

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

const TruthSample& EstimationData::truth_at(Instant at) const {
  const auto found = std::lower_bound(truth.begin(), truth.end(), at,
                                      [](const TruthSample& t, Instant i) { return t.at < i; });
  FIDUCAP_ASSERT(found != truth.end() && found->at == at);
  return *found;
}

TruthSample EstimationData::truth_near(Instant at) const {
  const auto after = std::lower_bound(truth.begin(), truth.end(), at,
                                      [](const TruthSample& t, Instant i) { return t.at < i; });
  if (after == truth.end()) return truth.back();
  if (after->at == at || after == truth.begin()) return *after;
  const auto before = after - 1;
  return between(*before, *after, rate_at(before->at), rate_at(after->at), at);
}

Eigen::Vector3d EstimationData::rate_at(Instant at) const {
  FIDUCAP_ASSERT(truth.size() >= 3);
  auto nearest = std::lower_bound(truth.begin(), truth.end(), at,
                                  [](const TruthSample& t, Instant i) { return t.at < i; });
  if (nearest == truth.end() ||
      (nearest != truth.begin() && at - (nearest - 1)->at < nearest->at - at))
    --nearest;
  const TruthSample* here = &*nearest;
  here = std::clamp(here, truth.data() + 1, truth.data() + truth.size() - 2);
  const TruthSample* before = here - 1;
  const TruthSample* after = here + 1;
  // Second order, although the steps differ: the mean rates of both steps belong to their middles.
  const double h1 = to_seconds(here->at - before->at);
  const double h2 = to_seconds(after->at - here->at);
  const Eigen::Vector3d w1 = log_so3(before->X_WB.q.conjugate() * here->X_WB.q) / h1;
  const Eigen::Vector3d w2 = log_so3(here->X_WB.q.conjugate() * after->X_WB.q) / h2;
  return (h2 * w1 + h1 * w2) / (h1 + h2);
}

const RecordedTag* EstimationData::tag(int tag_id) const {
  const auto found = std::find_if(tags.begin(), tags.end(),
                                  [&](const RecordedTag& t) { return t.tag_id == tag_id; });
  return found == tags.end() ? nullptr : &*found;
}

double EstimationData::path_m(Instant at) const {
  double length = 0;
  for (std::size_t i = 1; i < truth.size() && truth[i].at <= at; ++i) {
    length += (truth[i].X_WB.p - truth[i - 1].X_WB.p).norm();
  }
  return length;
}

int most_seen_tag(const EstimationData& data) {
  std::map<int, int> count;
  for (const SensorSample& sample : data.samples) {
    const auto* image = std::get_if<CornerFrame>(&sample);
    if (image == nullptr) continue;
    for (const TagSighting& tag : image->tags) {
      if (tag.tag_id != data.reference_tag) ++count[tag.tag_id];
    }
  }
  const auto most = std::max_element(
      count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == count.end() ? -1 : most->first;
}

EstimationData simulate(const SimulatedDataSetup& setup) {
  simulation::RoomConfig room;
  room.preset = setup.world == "big" ? "ceiling" : setup.world == "hover" ? "hall" : setup.world;
  room.daylight = setup.daylight;
  room.ring = setup.ring;
  room.gravity_m_s2 = setup.gravity_m_s2;
  constexpr int kIdsOf36h11 = 587;
  if (room.ring.tags > kIdsOf36h11) room.family = "tagStandard41h12";
  simulation::SimulatedBodyConfig body;
  body.cameras = simulated_rig(setup);
  body.has_imu = setup.has_imu;
  body.camera.images = !setup.images_for.empty() || !setup.texture.empty();
  body.camera.exposure_s = setup.exposure_s;
  body.camera.min_side_px = setup.min_side_px;
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
  const ImuNoise told = body.imu.noise;
  body.imu.noise = scaled(told, setup.imu_noise_factor);
  auto motion = simulation::make_trajectory(body.trajectory, room, body.cameras.front().X_BV);
  if (!motion) throw std::runtime_error(motion.error().text());
  if (setup.tag_size_m > 0) room.tag_size_m = setup.tag_size_m;
  auto source = simulation::make_simulated_source(room, body, kStart, nullptr, std::move(*motion));
  if (!source) throw std::runtime_error(source.error().text());

  EstimationData data;
  data.name = setup.world + " " + std::to_string(setup.seed);
  data.tags = simulation::tags_of(room);
  data.tag_set.family = room.family;
  set_sizes(data);
  data.camera = body.cameras.front();
  data.camera.readout_s = setup.readout_told_s;
  data.camera.readout_sigma_s = setup.readout_sigma_s;
  data.nominal_X_BV = drawn_extrinsics(data.camera, setup.seed);
  data.camera.model = drawn_lens(data.camera.model, setup, 0);
  for (std::size_t k = 1; k < body.cameras.size(); ++k) {
    CameraMount mount = body.cameras[k];
    mount.model = drawn_lens(mount.model, setup, k);
    mount.X_BV = drawn_extrinsics(mount, setup.seed * 4 + k);
    data.other_cameras.push_back(mount);
  }
  if (setup.has_imu) data.imu = told;
  collect(data, setup, room, **source);
  data.reference_tag = first_tag(data);

  std::vector<Instant> times;
  for (const SensorSample& sample : data.samples) times.push_back(time_of(sample));
  // Where samples are missing or have wrong stamps, and past the last image.
  const double period_s = 1 / body.imu.noise.rate_hz;
  for (double t_s = 0; t_s <= setup.seconds + period_s; t_s += period_s)
    times.push_back(kStart + from_seconds(t_s));
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  for (const Instant at : times) data.truth.push_back((*source)->truth(at));
  return data;
}

Expected<EstimationData> load_estimation_data(const std::string& folder) {
  const auto info = read_recording_info(folder);
  if (!info) return tl::unexpected(info.error());
  auto truth = read_truth(folder);
  if (!truth) return tl::unexpected(truth.error());
  auto tags = read_truth_tags(folder);
  if (!tags) return tl::unexpected(tags.error());
  const auto extrinsics = read_truth_extrinsics(folder);
  if (!extrinsics) return tl::unexpected(extrinsics.error());
  if (truth->empty() || tags->empty() || extrinsics->size() != 1 || info->cameras.size() != 1 ||
      !info->imu) {
    return fail(ErrorCode::kInvalid,
                "needs one camera, an IMU and the truth of body, tags and extrinsics", folder);
  }
  const SystemClock clock;
  auto source = open_recording(*info, {}, clock);
  if (!source) return tl::unexpected(source.error());

  EstimationData data;
  data.name = info->name;
  data.samples = merged(**source, true, Instant::max());
  data.truth = std::move(*truth);
  data.tags = std::move(*tags);
  std::sort(data.tags.begin(), data.tags.end(),
            [](const RecordedTag& a, const RecordedTag& b) { return a.tag_id < b.tag_id; });
  data.tag_set.family = info->tag_family;
  set_sizes(data);
  data.camera = info->cameras.front();
  data.nominal_X_BV = data.camera.X_BV;
  data.camera.X_BV = extrinsics->front();
  data.imu = info->imu;
  add_image_times(data);
  data.reference_tag = info->reference_tag ? *info->reference_tag : first_tag(data);
  return data;
}

}  // namespace fiducap
