#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>

#include <nlohmann/json.hpp>

#include "base/gravity.hpp"
#include "base/pose.hpp"
#include "capture/recording/recording_writer.hpp"
#include "simulation/simulation.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

struct SimulateArguments {
  std::string out;
  std::string room{"hall"};
  double seconds{60};
  std::uint64_t seed{1};
  bool images{false};   ///< Render images …
  bool corners{false};  ///< … or write corners only; so also when neither is set.
  bool imu{true};
  double speed{1.0};
  double corner_noise_px{0.4};
  double gravity_m_s2{kUsualGravity_m_s2};  ///< The true one; it is not part of the recording.
  bool json{false};
};

// The calibration of the recording is off by these, in a direction drawn by the seed; the true one
// is in truth/.
constexpr double kNominalError_m = 0.005;
constexpr double kNominalError_rad = 0.5 * std::numbers::pi / 180;
constexpr Duration kTruthStep = std::chrono::milliseconds(5);
// All recordings of data/ begin here.
constexpr std::int64_t kEpoch_ns = 1'600'000'000'000'000'000;

/// Uniform on the unit sphere. Made from raw numbers: the distributions of the standard library
/// differ between libraries.
Eigen::Vector3d direction(std::mt19937_64& random) {
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  const double z = 2 * uniform() - 1;
  const double angle = 2 * std::numbers::pi * uniform();
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

simulation::SimulatedBodyConfig simulated_body(const SimulateArguments& arguments) {
  simulation::SimulatedBodyConfig body;
  CameraMount camera;
  camera.model = {752, 480, 460, 460, 376, 240, Distortion::kNone, {}};
  // Off the axes and off the IMU, so that zeros hide no errors.
  camera.X_BV = simulation::forward_camera();
  camera.X_BV.p = {0.06, -0.015, 0.02};
  camera.X_BV.q = (camera.X_BV.q * exp_so3({0.02, -0.015, 0.01})).normalized();
  body.cameras = {camera};
  body.has_imu = arguments.imu;
  body.camera.images = arguments.images;
  body.camera.corner_noise_px = arguments.corner_noise_px;
  body.trajectory.kind = arguments.room == "hall" ? "survey" : arguments.room;
  body.trajectory.duration_s = arguments.seconds;
  body.trajectory.speed = arguments.speed;
  body.trajectory.seed = arguments.seed;
  body.seed = arguments.seed;
  return body;
}

RecordingInfo recording_of(const SimulateArguments& arguments,
                           const simulation::SimulatedBodyConfig& body,
                           const std::vector<RecordedTag>& tags) {
  RecordingInfo info;
  info.folder = arguments.out;
  info.name = std::filesystem::path(arguments.out).filename().string();
  std::mt19937_64 random(arguments.seed);
  for (CameraMount camera : body.cameras) {
    camera.X_BV.p += kNominalError_m * direction(random);
    camera.X_BV.q = (camera.X_BV.q * exp_so3(kNominalError_rad * direction(random))).normalized();
    info.cameras.push_back(camera);
    info.has_images.push_back(arguments.images);
    info.has_corners.push_back(!arguments.images);
  }
  if (body.has_imu) info.imu = body.imu.noise;
  info.tag_size_m = tags.front().edge_m;
  for (const RecordedTag& tag : tags)
    if (tag.edge_m != info.tag_size_m) info.tag_sizes_m[tag.tag_id] = tag.edge_m;
  info.reference_tag = tags.front().tag_id;
  return info;
}

Expected<void> write_truth(RecordingWriter& writer, const simulation::SimulatedSource& source,
                           const simulation::SimulatedBodyConfig& body,
                           const std::vector<RecordedTag>& tags, double seconds) {
  const Instant end = source.start() + from_seconds(seconds);
  for (Instant at = source.start(); at <= end; at += kTruthStep)
    if (auto written = writer.write_truth(source.truth(at)); !written) return written;
  std::vector<Pose> X_BV;
  for (const CameraMount& camera : body.cameras) X_BV.push_back(camera.X_BV);
  if (auto written = writer.write_truth_extrinsics(X_BV); !written) return written;
  if (auto written = writer.write_truth_tags(tags); !written) return written;
  return writer.finish();
}

Expected<int> write_samples(RecordingWriter& writer, simulation::SimulatedSource& source,
                            double seconds, const Terminal& terminal) {
  ProgressLine line(terminal);
  int frames = 0;
  for (;;) {
    auto sample = source.next({});
    if (!sample) return tl::unexpected(sample.error());
    if (!*sample) return frames;
    frames += std::holds_alternative<ImuSample>(**sample) ? 0 : 1;
    if (auto written = writer.write(**sample); !written) return tl::unexpected(written.error());
    line.show("simulating: " + fixed(to_seconds(time_of(**sample) - source.start()), 1) + " of " +
              fixed(seconds, 0) + " s");
  }
}

Expected<int> simulate(const SimulateArguments& arguments, const Terminal& terminal) {
  simulation::RoomConfig room;
  room.preset = arguments.room;
  room.gravity_m_s2 = arguments.gravity_m_s2;
  const simulation::SimulatedBodyConfig body = simulated_body(arguments);
  auto faults = simulation::check(room, "room.");
  for (auto& fault : simulation::check(body, "body.")) faults.push_back(std::move(fault));
  if (!faults.empty()) return fail(ErrorCode::kInvalid, faults.front().text());
  const std::vector<RecordedTag> tags = simulation::tags_of(room);
  auto source = simulation::make_simulated_source(room, body, instant_from_ns(kEpoch_ns), nullptr);
  if (!source) return tl::unexpected(source.error());
  auto writer = RecordingWriter::create(recording_of(arguments, body, tags));
  if (!writer) return tl::unexpected(writer.error());
  const auto frames = write_samples(*writer, **source, arguments.seconds, terminal);
  if (!frames) return frames;
  if (auto written = write_truth(*writer, **source, body, tags, arguments.seconds); !written)
    return tl::unexpected(written.error());
  return frames;
}

int run_simulate(const SimulateArguments& arguments, const Terminal& terminal) {
  const auto frames = simulate(arguments, terminal);
  if (!frames) return report(terminal, frames.error());
  if (arguments.json)
    return print_json(terminal, {{"recording", arguments.out},
                                 {"frames", *frames},
                                 {"images", arguments.images},
                                 {"imu", arguments.imu},
                                 {"seconds", arguments.seconds},
                                 {"room", arguments.room},
                                 {"seed", arguments.seed}});
  terminal.out << arguments.out << ": " << *frames
               << (arguments.images ? " images" : " frames of corners") << " in "
               << fixed(arguments.seconds, 0) << " s, room '" << arguments.room << "', seed "
               << arguments.seed << "\n"
               << "next: fiducap replay " << arguments.out << " --out results\n";
  return kExitOk;
}

}  // namespace

void add_simulate(CLI::App& app, ChosenVerb& chosen) {
  auto* verb = app.add_subcommand("simulate", "Write a recording of a simulated robot, with truth");
  auto& a = arguments_of<SimulateArguments>(*verb, chosen, run_simulate);
  verb->add_option("--out", a.out, "New folder for the recording")->required();
  verb->add_option("--room", a.room, "hall, table, sparse, loop or ceiling")
      ->check(CLI::IsMember({"hall", "table", "sparse", "loop", "ceiling"}))
      ->capture_default_str();
  add_positive(*verb, "--seconds", a.seconds, "Length");
  verb->add_option("--seed", a.seed, "Same seed, same recording")->capture_default_str();
  add_positive(*verb, "--speed", a.speed, "Scales the time of the motion");
  verb->add_option("--corner-noise-px", a.corner_noise_px,
                   "With --corners: 1-sigma of each coordinate")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  add_positive(*verb, "--gravity", a.gravity_m_s2,
               "Of the simulated place, m/s²; not part of the recording");
  auto* images = verb->add_flag("--images", a.images, "Render images");
  verb->add_flag("--corners", a.corners, "Corners only (the default): a thousand times quicker")
      ->excludes(images);
  verb->add_flag_callback(
      "--no-imu", [&a] { a.imu = false; }, "A robot without IMU");
  verb->add_flag("--json", a.json, "One JSON object for scripts");
  verb->footer(
      "Example:\n  fiducap simulate --out recordings/table --room table --seconds 60 --seed 7");
}

}  // namespace fiducap
