// A lab's first day: config/one_robot.yaml with its guessed lens, on rendered images of another
// one: reports with their times, the estimated lens, and the errors of the poses.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string_view>

#include "base/pose.hpp"
#include "daemon/bodies/body_setup.hpp"
#include "daemon/config/config_file.hpp"
#include "estimation/options.hpp"
#include "pipeline/replay/bodies_replay.hpp"
#include "simulation/random.hpp"
#include "simulation/simulation.hpp"
#include "support/memory_source.hpp"

namespace fiducap::bench {

namespace {

constexpr Instant kStart = instant_from_ns(1'000'000'000);
constexpr double kDay_s = 40.0;
constexpr double kPercent = 100.0;
constexpr double kEarly_s = 5.0;   // poses of the first seconds …
constexpr double kLater_s = 20.0;  // … and those of a calibrated lens
constexpr double kCentreOff_px = 12.0;
constexpr double kBarrel = -0.05;  // k1 of a lens that is configured without distortion
const std::vector<double> kSampledAt_s{2, 5, 10, 20, 40};

/// The true lens, relative to the configured one.
struct TrueLens {
  const char* name;
  double factor;
  double centre_px{0};
  double k1{0};
};
constexpr std::string_view kQuickLens = "8 % longer";
constexpr TrueLens kLenses[] = {{"as configured", 1.0},
                                {"8 % longer", 1.08},
                                {"8 % shorter", 0.92},
                                {"3 % longer", 1.03},
                                {"8 %, centre", 1.08, kCentreOff_px},
                                {"8 %, barrel", 1.08, 0, kBarrel}};

/// Configured uncertainty.
struct Trust {
  const char* name;
  bool is_guessed;  ///< As in the file.
  bool doubts;
  bool refines;
};
constexpr std::array<Trust, 4> kTrusts{{{"exact", false, false, false},
                                        {"doubted", false, true, false},
                                        {"guessed", true, true, false},
                                        {"refined", false, true, true}}};

ServerConfig one_robot() {
  auto config = load_config(FIDUCAP_SOURCE_DIR "/config/one_robot.yaml");
  if (!config) throw std::runtime_error(config.error().front().text());
  return std::move(*config);
}

/// A day's samples, images rendered, and the truth.
struct Day {
  std::unique_ptr<simulation::SimulatedSource> source;
  std::vector<SensorSample> samples;
  std::vector<RecordedTag> tags;
  std::optional<ImuNoise> imu;
  double true_fu{};
};

CameraMount true_camera(const CameraMount& configured, const TrueLens& lens, std::uint64_t seed) {
  CameraMount camera = configured;
  camera.model.fu *= lens.factor;
  camera.model.fv *= lens.factor;
  camera.model.cu += lens.centre_px;
  camera.model.cv -= lens.centre_px;
  camera.model.coefficients[0] = lens.k1;
  simulation::Random random(seed, simulation::Purpose::kRoom, 1000);
  camera.X_BV.p += configured.position_sigma_m * random.normal3();
  camera.X_BV.q =
      (camera.X_BV.q * exp_so3(configured.rotation_sigma_rad * random.normal3())).normalized();
  return camera;
}

Day render(const CameraMount& configured, double tag_size_m, const std::string& world,
           const TrueLens& lens, bool has_imu, std::uint64_t seed, double seconds) {
  simulation::RoomConfig room;
  room.preset = world;
  room.tag_size_m = tag_size_m;
  simulation::SimulatedBodyConfig body;
  body.cameras = {true_camera(configured, lens, seed)};
  body.has_imu = has_imu;
  body.camera.exposure_s = 0.008;
  body.trajectory.kind = world == "hall" ? "survey" : world;
  body.trajectory.seed = seed;
  body.seed = seed;
  auto source = simulation::make_simulated_source(room, body, kStart, nullptr);
  if (!source) throw std::runtime_error(source.error().text());
  Day day{std::move(*source), {}, simulation::tags_of(room), {}, body.cameras[0].model.fu};
  if (has_imu) day.imu = body.imu.noise;
  for (;;) {
    auto sample = day.source->next({});
    if (!sample || !*sample || to_seconds(time_of(**sample) - kStart) > seconds) return day;
    day.samples.push_back(std::move(**sample));
  }
}

/// The tag nearest to the optical axis at the start: it was surveyed.
const RecordedTag& first_seen(const Day& day) {
  const Pose X_VW = (day.source->truth(kStart).X_WB * day.source->cameras().front().X_BV).inverse();
  const auto off_axis = [&](const RecordedTag& tag) {
    const Eigen::Vector3d p = X_VW * tag.X_WT.p;
    return std::atan2(p.head<2>().norm(), p.z());
  };
  return *std::min_element(
      day.tags.begin(), day.tags.end(),
      [&](const RecordedTag& a, const RecordedTag& b) { return off_axis(a) < off_axis(b); });
}

struct Score {
  std::vector<double> early_mm, later_mm, later_nees, sigma_mm;
  std::vector<std::pair<double, std::string>> reports;
  std::vector<std::string> lens_at;  ///< Per kSampledAt_s: error ± sigma.
  int images{}, valid{}, resets{};
};

class Watcher {
 public:
  Watcher(const Day& day, const BodyConfig& body, double configured_fu)
      : day_(day), body_(body), configured_fu_(configured_fu) {}

  void take(const BodyUpdate& update, const BodyPipeline& pipeline) {
    const double t_s = to_seconds(update.seen.exposed_at - day_.source->start());
    ++score_.images;
    for (const BodyEvent& event : update.events) {
      score_.resets += event.kind == BodyEvent::Kind::kReset ? 1 : 0;
      if (!event.text.empty()) score_.reports.emplace_back(t_s, event.text);
    }
    if (score_.lens_at.size() < kSampledAt_s.size() &&
        t_s >= kSampledAt_s[score_.lens_at.size()] - 0.1)
      note_lens(pipeline);
    if (!update.is_placed()) return;
    const BodyEstimate& now = *update.estimate;
    if (!may_be_shown(now.covariance, body_.limits)) return;
    ++score_.valid;
    note_error(now, t_s);
  }
  Score finish() { return std::move(score_); }

 private:
  void note_lens(const BodyPipeline& pipeline) {
    const LensEstimate lens = pipeline.cameras().front().lens;
    const double fu = configured_fu_ * (1 + lens.offset.focal);
    std::string error = fmt::format("{:+.2f}", kPercent * (fu / day_.true_fu - 1));
    if (lens.focal_sigma > 0) error += fmt::format(" ± {:.2f}", kPercent * lens.focal_sigma);
    score_.lens_at.push_back(std::move(error));
  }

  void note_error(const BodyEstimate& now, double t_s) {
    const Vector6d e = pose_error(now.X_WB, day_.source->truth(now.at).X_WB);
    const double error_mm = kMm * e.head<3>().norm();
    if (t_s >= kEarly_s && t_s < kLater_s) score_.early_mm.push_back(error_mm);
    if (t_s < kLater_s) return;
    const Matrix6d P = now.covariance.topLeftCorner<6, 6>();
    score_.later_mm.push_back(error_mm);
    score_.sigma_mm.push_back(kMm * std::sqrt(P.topLeftCorner<3, 3>().trace()));
    score_.later_nees.push_back(normalised(e, P) / 6);
  }

  const Day& day_;
  const BodyConfig& body_;
  double configured_fu_;
  Score score_;
};

Score run_day(const Day& day, ServerConfig config, const Trust& trust) {
  BodyConfig& body = config.bodies.front();
  CameraMount& mount = body.cameras.front().mount;
  if (!trust.is_guessed) mount.focal_sigma = mount.centre_sigma_px = mount.k1_sigma = 0;
  config.estimator.doubt_configuration = trust.doubts;
  config.estimator.refine_intrinsics = trust.refines;
  const RecordedTag& surveyed = first_seen(day);
  config.map.reference_tag = surveyed.tag_id;
  config.map.reference_pose = surveyed.X_WT;
  for (const RecordedTag& tag : day.tags) config.tags.sizes_m[tag.tag_id] = tag.edge_m;
  auto setup = read_body_setup(body, config.simulation);
  if (!setup) throw std::runtime_error(setup.error().text());
  setup->sensors.imu = day.imu;
  MemorySource source(day.samples);
  TagMap map;
  map.reference_tag = config.map.reference_tag;
  std::vector<ReplayedBody> bodies{{1, body.name, pipeline_setup(config, body, *setup), &source}};
  BodiesReplay replay(std::move(bodies), config.map.builder, map);
  Watcher watcher(day, body, mount.model.fu);
  const auto done = replay.run(
      [&](std::size_t, const BodyUpdate& update) { watcher.take(update, replay.pipeline(0)); });
  if (!done) throw std::runtime_error(done.error().text());
  return watcher.finish();
}

std::vector<Cell> row(const std::string& world, const std::string& lens, bool has_imu,
                      const Trust& trust, const Score& score) {
  std::vector<Cell> out{world, lens, has_imu ? "yes" : "no", trust.name};
  for (std::size_t i = 0; i < kSampledAt_s.size(); ++i)
    out.emplace_back(i < score.lens_at.size() ? score.lens_at[i] : "");
  for (const auto* values : {&score.early_mm, &score.later_mm, &score.sigma_mm})
    out.emplace_back(Figure{median(*values), 1});
  out.emplace_back(Figure{median(score.later_nees), 2});
  out.emplace_back(Figure{kPercent * score.valid / std::max(1, score.images), 0});
  out.emplace_back(std::to_string(score.resets));
  return out;
}

}  // namespace

std::vector<Table> bench_first_day(const EstimationOptions& options) {
  const ServerConfig config = one_robot();
  Table figures{
      "First day: config/one_robot.yaml on rendered images of another lens",
      split("class|true lens|IMU|lens|fu off % at 2 s|5 s|10 s|20 s|40 s|mm 5-20 s|mm later|"
            "sigma mm|NEES|with pose %|resets")};
  Table reports{"First reports", {"class", "true lens", "IMU", "lens", "s", "report"}};
  const double seconds = options.quick ? 4 : (options.seconds > 0 ? options.seconds : kDay_s);
  for (const std::string& world : options.classes) {
    for (const TrueLens& lens : kLenses) {
      if (!(options.quick ? lens.name == kQuickLens : options.includes(lens.name))) continue;
      for (const bool has_imu : {false, true}) {
        const Day day = render(config.bodies[0].cameras[0].mount, config.tags.size_m, world, lens,
                               has_imu, options.first_seed, seconds);
        std::array<Score, kTrusts.size()> scores;
        in_parallel(static_cast<int>(kTrusts.size()), options.threads, [&](int i) {
          const auto k = static_cast<std::size_t>(i);
          scores[k] = run_day(day, config, kTrusts[k]);
        });
        for (std::size_t k = 0; k < kTrusts.size(); ++k) {
          figures.rows.push_back(row(world, lens.name, has_imu, kTrusts[k], scores[k]));
          for (const auto& [at_s, text] : scores[k].reports)
            reports.rows.push_back(cells(world, lens.name, has_imu ? "yes" : "no", kTrusts[k].name,
                                         Figure{at_s, 1}, text));
        }
      }
    }
  }
  figures.remarks.emplace_back(
      "exact: nothing is doubted. doubted: sigmas of 0. guessed: as in the file. refined: sigmas "
      "of 0 and refine_intrinsics. mm, sigma, NEES per degree of freedom: medians of poses that "
      "may be shown; later: from 20 s on.");
  return {figures, reports};
}

}  // namespace fiducap::bench
