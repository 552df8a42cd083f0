// fiducap_bench stages: CPU time of the working thread per stage, and the latency in real time.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <thread>
#include <vector>

#include "base/log.hpp"
#include "base/process.hpp"
#include "bench.hpp"
#include "daemon/server.hpp"
#include "daemon/system.hpp"
#include "detection/tag_detector.hpp"
#include "fiducap/client.hpp"
#include "scene/scene.hpp"
#include "simulation/simulation.hpp"
#include "streaming/native/frames.hpp"
#include "streaming/vrpn/codec.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::bench {
namespace {

void print_row(const std::string& what, const std::string& per, double median_us, double p99_us,
               const std::string& remark) {
  std::printf("%-34s %-22s %12.2f %12.2f  %s\n", what.c_str(), per.c_str(), median_us, p99_us,
              remark.c_str());
}

void print(const std::string& what, const std::string& per, std::vector<double> times_us,
           const std::string& remark = {}) {
  if (times_us.empty()) return print_row(what, per, 0, 0, "nothing measured");
  std::sort(times_us.begin(), times_us.end());
  const auto at = [&](double share) {
    return times_us[static_cast<std::size_t>(share * static_cast<double>(times_us.size() - 1))];
  };
  print_row(what, per, at(0.5), at(0.99), remark);
}

template <typename Operation>
double cpu_us(Operation&& operation) {
  const Duration begin = thread_cpu_time();
  operation();
  return to_seconds(thread_cpu_time() - begin) * 1e6;
}

/// Measures `operation` `repeats` times, `batch` of them between two readings of the clock.
template <typename Operation>
std::vector<double> measure(int repeats, int batch, Operation&& operation) {
  std::vector<double> times_us;
  for (int r = 0; r < repeats; ++r) {
    times_us.push_back(cpu_us([&] {
                         for (int b = 0; b < batch; ++b) operation();
                       }) /
                       batch);
  }
  return times_us;
}

int repeats(bool quick, int full) { return quick ? std::max(3, full / 20) : full; }

/// Rendered images of a robot that walks through the simulated hall.
std::vector<CameraFrame> rendered_images(int count) {
  CameraMount camera;
  camera.model = {
      752, 480, 460, 460, 376, 240, Distortion::kRadialTangential, {-0.28, 0.07, 2e-4, 2e-5, 0}};
  camera.X_BV = simulation::forward_camera();
  camera.rate_hz = 2;  // far apart, so that no image repeats the one before
  simulation::SimulatedBodyConfig body;
  body.cameras = {camera};
  body.has_imu = false;
  body.trajectory.duration_s = count / camera.rate_hz;
  const auto source = simulation::make_simulated_source({}, body, instant_from_ns(0), nullptr);
  std::vector<CameraFrame> images;
  while (source && static_cast<int>(images.size()) < count) {
    auto sample = (*source)->next({});
    if (!sample || !*sample) break;
    if (const auto* image = std::get_if<CameraFrame>(&**sample)) images.push_back(*image);
  }
  return images;
}

void bench_detector(bool quick) {
  const std::vector<CameraFrame> images = rendered_images(repeats(quick, 60));
  for (const double decimate : {2.0, 1.0}) {
    DetectorConfig config;
    config.decimate = decimate;
    TagDetector detector({}, config);
    std::vector<double> times_us;
    std::size_t tags = 0;
    for (const CameraFrame& image : images)
      times_us.push_back(cpu_us([&] { tags += detector.detect(image).tags.size(); }));
    const double per_image =
        images.empty() ? 0.0 : static_cast<double>(tags) / static_cast<double>(images.size());
    print(fmt::format("detect, decimate {:.0f}", decimate), "image 752x480", std::move(times_us),
          fmt::format("{:.1f} tags per image", per_image));
  }
}

constexpr int kBodies = 8;
constexpr const char* kPerFrame = "frame of 8 bodies";

std::vector<std::string> body_names() {
  std::vector<std::string> all;
  for (int i = 1; i <= kBodies; ++i) all.push_back("body" + std::to_string(i));
  return all;
}

void bench_scene(bool quick) {
  std::vector<SceneBody> bodies;
  BodySensors sensors;
  sensors.cameras.resize(1);
  sensors.imu = ImuNoise{};
  for (const std::string& name : body_names())
    bodies.push_back({{static_cast<int>(bodies.size()) + 1, name}, {}, {}, sensors, {}});
  Scene scene(bodies);
  const auto map = std::make_shared<const TagMap>();
  // The longest prediction: an image every 50 ms and IMU samples every 5 ms since.
  Instant now = instant_from_ns(1'000'000'000);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    BodyEstimate estimate;
    estimate.at = now;
    estimate.anchored = true;
    estimate.covariance = Matrix15d::Identity() * 1e-6;
    UpdateReport report;
    report.exposed_at = now;
    report.tags_used = 3;
    report.running = true;
    scene.ingest(b, estimate, report, Duration{0}, 0);
    for (int i = 1; i <= 10; ++i)
      scene.add_imu(b, {now + std::chrono::milliseconds(5 * i), {0.1, 0.2, 0.3}, {0, 0, 9.81}});
  }
  now += std::chrono::milliseconds(52);
  print("scene sample", kPerFrame, measure(repeats(quick, 2000), 5, [&] {
          (void)scene.sample(now, now, Duration{0}, 100, map);
        }));
}

void bench_encoders(bool quick) {
  const auto frame = make_scene_frame(body_names());
  const int times = repeats(quick, 2000);
  native::FrameEncoder native(1);
  print("encode native", kPerFrame, measure(times, 20, [&] { (void)native.encode(*frame); }));
  std::vector<std::int32_t> senders;
  for (int i = 0; i < kBodies; ++i) senders.push_back(i);
  vrpn::EncodedFrame encoded;
  const vrpn::ReportEncoder vrpn({}, {});
  print("encode vrpn, pose and velocity", kPerFrame,
        measure(times, 20, [&] { vrpn.encode(*frame, senders, {}, encoded); }));
}

// An uncommon port, so that a server that runs on this machine is left alone.
constexpr const char* kLatencyConfig = R"(
simulation: {preset: hall}
map: {mode: mapping}
bodies:
  - name: robot
    source: {type: simulator, camera: {images: false}, trajectory: {kind: survey}}
    cameras:
      - model: {width: 752, height: 480, fu: 460, fv: 460, cu: 376, cv: 240}
        X_BV: {p: [0.1, 0, 0], q_wxyz: [0.5, -0.5, 0.5, -0.5]}
        rate_hz: 20
streaming:
  rate_hz: 200
  native: {port: 42617}
  vrpn: {enabled: false}
  web: {enabled: false}
)";

/// A real server and a real client on loopback, in real time.
void bench_latency(bool quick) {
  const char* what = "latency, instant of pose to client";
  const char* per = "frame at 200 Hz";
  const auto config = parse_config(kLatencyConfig, "bench");
  const SystemClock clock;
  auto server = config ? Server::build(*config, {}, clock)
                       : fail(ErrorCode::kInvalid, config.error().front().text());
  if (!server) return print_row(what, per, 0, 0, "not measured: " + server.error().text());
  std::thread serving([&] { (void)(*server)->run(); });
  {
    ClientOptions to_server;
    to_server.port = 42617;
    Client client(to_server);
    std::this_thread::sleep_for(std::chrono::seconds(quick ? 2 : 8));
    const ClientStatistics statistics = client.statistics();
    print_row(what, per, 1e6 * statistics.latency_p50_s, 1e6 * statistics.latency_p99_s,
              fmt::format("real time; {} frames, {} lost, {:.1f} Hz", statistics.frames,
                          statistics.lost, statistics.rate_hz));
  }
  (*server)->stop();
  serving.join();
}

}  // namespace

Bench add_stages(CLI::App&, const bool& quick) {
  return [&quick] {
    log::set_level(log::Level::kWarning);
    std::printf("%-34s %-22s %12s %12s  %s\n", "what", "per", "median [us]", "p99 [us]", "remark");
    bench_detector(quick);
    bench_scene(quick);
    bench_encoders(quick);
    bench_latency(quick);
    return 0;
  };
}

}  // namespace fiducap::bench
