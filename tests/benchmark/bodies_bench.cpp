// fiducap_bench bodies: a real server with N bodies, each with a camera of 752 × 480 at 20 Hz and
// an IMU at 200 Hz, limited to some cores, and a client in a process of its own on the others.
// Images are rendered before the clock starts; reading and rendering them is not in the figures.
// Bodies start with an empty map.
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <memory>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "base/log.hpp"
#include "bench.hpp"
#include "daemon/server.hpp"
#include "daemon/system.hpp"
#include "fiducap/client.hpp"

namespace fiducap::bench {
namespace {

// Uncommon, so that a server that runs on this machine is left alone.
constexpr std::uint16_t kBodiesPort = 42619;
constexpr std::size_t kFlights = 2;  // rendered ones; bodies share them, some milliseconds apart

/// Samples of a simulated body, rendered before anything is measured.
struct Prerendered {
  std::vector<SensorSample> samples;  ///< In order of arrival, stamped from 0.
  Duration image_latency{};
};

Prerendered prerender(const simulation::RoomConfig& room,
                      const simulation::SimulatedBodyConfig& body) {
  Prerendered made;
  made.image_latency = from_seconds(body.camera.latency_s);
  const auto source = simulation::make_simulated_source(room, body, instant_from_ns(0), nullptr);
  while (source) {
    auto sample = (*source)->next({});
    if (!sample || !*sample) break;
    made.samples.push_back(std::move(**sample));
  }
  return made;
}

/// Gives them in real time from `start` on. Images are shared, not copied: the work of a camera's
/// driver is not in the figures.
class PrerenderedSource final : public SensorSource {
 public:
  PrerenderedSource(std::shared_ptr<const Prerendered> material, Instant start, const Clock& clock)
      : material_(std::move(material)), start_(start), clock_(clock) {}
  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    if (next_ == material_->samples.size()) return std::nullopt;
    SensorSample sample = material_->samples[next_++];
    Instant due = start_ + (time_of(sample) - instant_from_ns(0));
    if (auto* imu = std::get_if<ImuSample>(&sample)) {
      imu->sampled_at = due;
    } else if (auto* image = std::get_if<CameraFrame>(&sample)) {
      image->exposed_at = due;
      due += material_->image_latency;
    }
    if (!clock_.wait_until(due, stop)) return std::nullopt;
    return std::optional<SensorSample>(std::move(sample));
  }

 private:
  std::shared_ptr<const Prerendered> material_;
  Instant start_;
  const Clock& clock_;
  std::size_t next_{0};
};

struct BodiesOptions {
  int bodies{8};
  int seconds{20};
  std::vector<int> cores{0, 1};
  std::vector<std::string> overrides;
};

std::string config_text(const BodiesOptions& options) {
  std::string text = R"(
simulation: {preset: hall}
tags: {size_m: 0.4}
map: {mode: mapping}
streaming: {rate_hz: 200, vrpn: {enabled: false}, web: {enabled: false}, native: {port: 42619}}
bodies:
)";
  for (int i = 0; i < options.bodies; ++i) {
    text += "  - {name: body" + std::to_string(i + 1) +
            ", source: {type: simulator, camera: {images: false}, trajectory: {kind: survey}}, "
            "cameras: [{model: {width: 752, height: 480, fu: 460, fv: 460, cu: 376, cv: 240, "
            "distortion: radial-tangential, coefficients: [-0.28, 0.07, 0.0002, 0.00002, 0]}, "
            "X_BV: {p: [0.1, 0, 0], q_wxyz: [0.5, -0.5, 0.5, -0.5]}, rate_hz: 20}]}\n";
  }
  return text;
}

/// Limits this process to `cores`, or to the others.
void limit_to(const std::vector<int>& cores, bool others) {
  cpu_set_t set;
  CPU_ZERO(&set);
  const int count = static_cast<int>(std::thread::hardware_concurrency());
  for (int core = 0; core < count; ++core) {
    const bool named = std::find(cores.begin(), cores.end(), core) != cores.end();
    if (named != others) CPU_SET(static_cast<std::size_t>(core), &set);
  }
  if (CPU_COUNT(&set) == 0 || sched_setaffinity(0, sizeof set, &set) != 0)
    std::fprintf(stderr, "could not choose cores; the figures are those of all of them\n");
}

/// Takes options.seconds. Without poses the latency would be that of an idle server.
/// @return when all bodies had a pose for the first time, in whole seconds; nullopt: never
std::optional<int> await_all_poses(const Client& client, const BodiesOptions& options) {
  std::optional<int> first_s;
  Frame frame;
  for (int s = 1; s <= options.seconds; ++s) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    const bool all = client.latest(frame) &&
                     frame.bodies.size() == static_cast<std::size_t>(options.bodies) &&
                     std::all_of(frame.bodies.begin(), frame.bodies.end(),
                                 [](const Body& body) { return body.valid; });
    if (all && !first_s) first_s = s;
  }
  return first_s;
}

/// The client's own process.
int watch(const BodiesOptions& options) {
  limit_to(options.cores, true);
  ClientOptions to_server;
  to_server.port = kBodiesPort;
  Client client(to_server);
  const auto all_after_s = await_all_poses(client, options);
  const ClientStatistics s = client.statistics();
  std::printf(
      "client: %llu frames, %llu lost, %.1f Hz; instant of pose to datagram read p50 %.0f us, p99 "
      "%.0f us\n",
      static_cast<unsigned long long>(s.frames), static_cast<unsigned long long>(s.lost), s.rate_hz,
      1e6 * s.latency_p50_s, 1e6 * s.latency_p99_s);
  if (all_after_s)
    std::printf("client: all %d bodies had poses after %d s\n", options.bodies, *all_after_s);
  else
    std::printf("client: never poses of all %d bodies in %d s\n", options.bodies, options.seconds);
  std::fflush(stdout);
  return 0;
}

std::vector<std::shared_ptr<const Prerendered>> render_flights(const ServerConfig& config,
                                                               const BodiesOptions& options) {
  std::vector<std::shared_ptr<const Prerendered>> flights;
  for (std::size_t k = 0; k < kFlights; ++k) {
    auto body = config.bodies.front().source.simulator;
    body.cameras = {config.bodies.front().cameras.front().mount};
    body.camera.images = true;
    body.trajectory.seed = body.seed = k + 1;
    body.trajectory.duration_s = options.seconds;
    flights.push_back(std::make_shared<const Prerendered>(prerender(config.simulation, body)));
  }
  return flights;
}

int serve(const BodiesOptions& options) {
  const auto config = parse_config(config_text(options), "bench", options.overrides);
  if (!config) {
    std::fprintf(stderr, "%s\n", config.error().front().text().c_str());
    return 1;
  }
  const auto flights = render_flights(*config, options);
  const pid_t client = fork();  // before there is any thread
  if (client == 0) _exit(watch(options));
  limit_to(options.cores, false);
  const SystemClock clock;
  const Instant start = clock.now() + std::chrono::milliseconds(300);
  std::size_t made = 0;
  ServerOptions server_options;
  server_options.exit_at_end = true;
  server_options.source = [&](const std::string&, std::unique_ptr<SensorSource>) {
    const Duration apart = std::chrono::milliseconds(6) * made;
    return std::make_unique<PrerenderedSource>(flights[made++ % kFlights], start + apart, clock);
  };
  const std::clock_t before = std::clock();
  auto server = Server::build(*config, server_options, clock);
  if (!server) {
    std::fprintf(stderr, "%s\n", server.error().text().c_str());
    return 1;
  }
  (void)(*server)->run();
  const double used = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
  (void)waitpid(client, nullptr, 0);
  std::printf(
      "server: %d bodies on %zu cores: %.2f s CPU in %d s (%.1f %% of one core), all threads\n",
      options.bodies, options.cores.size(), used, options.seconds, 100 * used / options.seconds);
  return 0;
}

}  // namespace

Bench add_bodies(CLI::App& verb, const bool& quick) {
  const auto options = std::make_shared<BodiesOptions>();
  verb.add_option("--bodies", options->bodies, "how many")->check(CLI::Range(1, 64));
  verb.add_option("--seconds", options->seconds, "how long")->check(CLI::Range(2, 120));
  verb.add_option("--cores", options->cores, "cores of the server")->delimiter(',');
  verb.add_option("overrides", options->overrides, "configuration, key=value");
  return [options, &quick] {
    if (quick) options->seconds = 3;
    log::set_level(log::Level::kInfo);
    return serve(*options);
  };
}

}  // namespace fiducap::bench
