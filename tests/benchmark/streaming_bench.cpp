#include "bench.hpp"
#include "scene/scene.hpp"
#include "streaming/native/frames.hpp"
#include "streaming/vrpn/codec.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::bench {
namespace {

constexpr int kBodies = 8;

std::vector<std::string> names() {
  std::vector<std::string> all;
  for (int i = 1; i <= kBodies; ++i) all.push_back("body" + std::to_string(i));
  return all;
}

void bench_encoders(const Options& options, std::vector<Row>& rows) {
  const auto frame = make_scene_frame(names());
  native::FrameEncoder native(1);
  rows.push_back(row_of("encode native", "frame of 8 bodies",
                        measure(options.repeats(2000), 20, [&] { (void)native.encode(*frame); })));
  std::vector<std::int32_t> senders;
  for (int i = 0; i < kBodies; ++i) senders.push_back(i);
  vrpn::EncodedFrame encoded;
  const vrpn::ReportEncoder vrpn({}, {});
  rows.push_back(row_of(
      "encode vrpn, pose and velocity", "frame of 8 bodies",
      measure(options.repeats(2000), 20, [&] { vrpn.encode(*frame, senders, {}, encoded); })));
}

void bench_scene(const Options& options, std::vector<Row>& rows) {
  std::vector<SceneBody> bodies;
  BodySensors sensors;
  sensors.cameras.resize(1);
  sensors.imu = ImuNoise{};
  for (int i = 0; i < kBodies; ++i)
    bodies.push_back({{i + 1, names()[static_cast<std::size_t>(i)]}, {}, {}, sensors, {}});
  Scene scene(bodies);
  const auto map = std::make_shared<const TagMap>();
  // An image every 50 ms and IMU samples every 5 ms since: what the predictor has to carry in the
  // worst case.
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
  rows.push_back(row_of("scene sample", "frame of 8 bodies", measure(options.repeats(2000), 5, [&] {
                          (void)scene.sample(now, now, Duration{0}, 100, map);
                        })));
}

}  // namespace

void bench_streaming(const Options& options, std::vector<Row>& rows) {
  bench_scene(options, rows);
  bench_encoders(options, rows);
}

}  // namespace fiducap::bench
