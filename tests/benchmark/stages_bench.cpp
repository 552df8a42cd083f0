// fiducap_bench stages: CPU time of the working thread for one frame.
#include <cstdio>
#include <vector>

#include "base/numeric.hpp"
#include "base/process.hpp"
#include "bench.hpp"
#include "scene/scene.hpp"
#include "streaming/native/frames.hpp"
#include "streaming/vrpn/codec.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::bench {
namespace {

constexpr int kBodies = 8;

/// Prints the CPU time of `operation`, measured `repeats` times with `batch` of them between two
/// readings of the clock.
template <typename Operation>
void measure(const char* what, int repeats, int batch, Operation&& operation) {
  std::vector<double> times_us;
  for (int r = 0; r < repeats; ++r) {
    const Duration begin = thread_cpu_time();
    for (int b = 0; b < batch; ++b) operation();
    times_us.push_back(1e6 * to_seconds(thread_cpu_time() - begin) / batch);
  }
  std::printf("%-34s %12.2f %12.2f\n", what, quantile(times_us, 0.5), quantile(times_us, 0.99));
}

void bench_scene(int repeats) {
  std::vector<SceneBody> bodies;
  BodySensors sensors;
  sensors.cameras.resize(1);
  sensors.imu = ImuNoise{};
  for (const std::string& name : numbered_names(kBodies))
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
  measure("scene sample", repeats, 5, [&] { (void)scene.sample(now, now, Duration{0}, 100, map); });
}

void bench_encoders(int repeats) {
  const auto frame = make_scene_frame(numbered_names(kBodies));
  native::FrameEncoder native(1);
  measure("encode native", repeats, 20, [&] { (void)native.encode(*frame); });
  std::vector<std::int32_t> senders;
  for (int i = 0; i < kBodies; ++i) senders.push_back(i);
  vrpn::EncodedFrame encoded;
  const vrpn::ReportEncoder vrpn({}, {});
  measure("encode vrpn, pose and velocity", repeats, 20,
          [&] { vrpn.encode(*frame, senders, {}, encoded); });
}

}  // namespace

Bench add_stages(CLI::App&, const bool& quick) {
  return [&quick] {
    std::printf("%-34s %12s %12s\n", "a frame of 8 bodies", "median [us]", "p99 [us]");
    const int repeats = quick ? 100 : 2000;
    bench_scene(repeats);
    bench_encoders(repeats);
    return 0;
  };
}

}  // namespace fiducap::bench
