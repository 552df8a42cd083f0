// fiducap_bench loop: control loops whose only feedback is our stream, over real sockets, in real
// time. The paper's experiment "Estimation in Closed Loop Control": a robot on a treadmill; and a
// quadrotor that hovers.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <deque>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "base/log.hpp"
#include "bench.hpp"
#include "closed_loop/plant.hpp"
#include "daemon/server.hpp"
#include "daemon/system.hpp"
#include "fiducap/client.hpp"
#include "mapping/formats/map_format.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap::loop {
namespace {

using namespace std::chrono_literals;

constexpr double kSettle_s = 8.0;  // after the first pose: the loop reaches its target
constexpr double kOtherDelay_s = 0.05;
constexpr double kRoom_m = 4.0;  // from the middle to the nearest wall
constexpr std::uint16_t kPort = 42618;

struct Gains {
  double position_1_s;
  double velocity_1_s;
  double integral_1_s2;
  double max_speed_m_s{1.0};
  double max_integral_m_s2{2.0};
};
/// Stable with a late velocity; stable with a prompt one only.
constexpr Gains kSoft{2.0, 5.0, 3.0};
constexpr Gains kStiff{2.5, 9.0, 9.0};

/// The controller of the paper's closed loop: an outer position loop gives a velocity, an inner
/// velocity loop with an integrator gives an acceleration.
class Cascade final {
 public:
  Cascade(const Gains& gains, const Eigen::Vector3d& target) : gains_(gains), target_(target) {}

  /// @return acceleration command, m/s²
  [[nodiscard]] Eigen::Vector3d update(const Eigen::Vector3d& p, const Eigen::Vector3d& v,
                                       double dt) {
    Eigen::Vector3d v_wanted = gains_.position_1_s * (target_ - p);
    if (v_wanted.norm() > gains_.max_speed_m_s) v_wanted *= gains_.max_speed_m_s / v_wanted.norm();
    const Eigen::Vector3d error = v_wanted - v;
    integral_ += gains_.integral_1_s2 * dt * error;
    integral_ = integral_.cwiseMax(-gains_.max_integral_m_s2).cwiseMin(gains_.max_integral_m_s2);
    return gains_.velocity_1_s * error + integral_;
  }

 private:
  Gains gains_;
  Eigen::Vector3d target_;
  Eigen::Vector3d integral_{Eigen::Vector3d::Zero()};
};

/// The demo's hall, corners instead of images so that four robots fit on two cores.
constexpr const char* kBody = R"(
    source: {type: simulator, camera: {images: false, corner_noise_px: 0.4}}
    cameras:
      - model: {width: 752, height: 480, fu: 460, fv: 460, cu: 376, cv: 240}
        X_BV: {p: [0.1, 0, 0], q_wxyz: [0.5, -0.5, 0.5, -0.5]}
        rate_hz: 20
)";

struct Robot {
  const char* name;
  bool flies;
  bool late;  ///< Its controller gets a stream as of other systems.
  bool stiff;
  Eigen::Vector3d target;
  Plant* plant{};  ///< Lives in the server's simulator.
  double squares{};
  double worst_m{};
  long long samples{};
  double sensed_squares{};  ///< Of the streamed position against the truth at its instant.
};

std::vector<Robot> robots() {
  return {{"treadmill", false, false, true, {0, 0, 0}},
          {"treadmill-other", false, true, true, {0, 0, 0}},
          {"quadrotor", true, false, false, {0, 0, 1.4}},
          {"quadrotor-other", true, true, false, {0, 0, 1.4}},
          {"quadrotor-stiff", true, false, true, {0, 0, 1.4}},
          {"quadrotor-stiff-other", true, true, true, {0, 0, 1.4}}};
}

/// A surveyed, frozen map, as control loops need.
std::string config_text(const std::vector<Robot>& all, const std::string& map_file) {
  std::string text =
      "tags: {size_m: 0.4}\nsimulation: {preset: hall}\nmap: {mode: frozen, file: " + map_file +
      "}\nstreaming: {rate_hz: 200, vrpn: {enabled: false}, web: {enabled: false}, native: "
      "{port: " +
      std::to_string(kPort) + "}}\nbodies:\n";
  for (const Robot& robot : all) text += std::string("  - name: ") + robot.name + kBody;
  return text;
}

/// The survey of the simulated hall.
std::string survey() {
  simulation::RoomConfig room;
  room.preset = "hall";
  TagMap map;
  for (const RecordedTag& tag : simulation::tags_of(room)) {
    MapTag entry;
    entry.tag = {tag.tag_id, tag.edge_m, tag.X_WT, Matrix6d::Zero()};
    entry.state = TagState::kSurveyed;
    map.tags.push_back(entry);
  }
  return map_to_yaml(map);
}

/// Input of a controller.
struct Sensed {
  double at_s{};  ///< On the client's clock of the stream.
  Eigen::Vector3d p;
  Eigen::Vector3d v;
};

/// The stream of other systems: late by `delay_s`, with the velocity as difference of two
/// positions.
class LateAndDifferenced final {
 public:
  explicit LateAndDifferenced(double delay_s) : delay_s_(delay_s) {}

  /// @return nullopt until something is old enough
  [[nodiscard]] std::optional<Sensed> pass(const Sensed& now) {
    waiting_.push_back(now);
    bool fresh = false;
    while (!waiting_.empty() && waiting_.front().at_s <= now.at_s - delay_s_) {
      Sensed next = waiting_.front();
      waiting_.pop_front();
      if (last_ && next.at_s > last_->at_s)
        next.v = (next.p - last_->p) / (next.at_s - last_->at_s);
      last_ = next;
      fresh = true;
    }
    return fresh ? last_ : std::nullopt;
  }

 private:
  double delay_s_;
  std::deque<Sensed> waiting_;
  std::optional<Sensed> last_;
};

/// One robot by the SDK.
class SdkFeed final {
 public:
  SdkFeed(const Client& client, const char* name) : client_(client), name_(name) {}

  [[nodiscard]] std::optional<Sensed> next() {
    if (!client_.wait_for_frame(frame_.number, 100ms) || !client_.latest(frame_))
      return std::nullopt;
    for (const Body& body : frame_.bodies) {
      if (body.name != name_ || !body.valid) continue;
      return Sensed{1e-9 * static_cast<double>(frame_.at_server_ns),
                    Eigen::Vector3d(body.position_m.data()),
                    Eigen::Vector3d(body.velocity_m_s.data())};
    }
    return std::nullopt;
  }

 private:
  const Client& client_;
  const char* name_;
  Frame frame_;
};

/// Errors of the robot against its target and of the stream against the robot, after settling.
void score(Robot& robot, const Sensed& sensed, double now_s, double start_s) {
  if (robot.plant->free_for() < kSettle_s) return;
  Eigen::Vector3d error = robot.plant->at(now_s).X_WB.p - robot.target;
  if (!robot.flies) error.z() = 0;  // the gait's, not controlled
  robot.squares += error.squaredNorm();
  robot.worst_m = std::max(robot.worst_m, error.norm());
  robot.sensed_squares += (robot.plant->at(sensed.at_s - start_s).X_WB.p - sensed.p).squaredNorm();
  ++robot.samples;
}

/// One controller.
void control(Robot& robot, SdkFeed feed, Instant start, const Clock& clock, std::stop_token stop) {
  Cascade cascade(robot.stiff ? kStiff : kSoft, robot.target);
  LateAndDifferenced other(kOtherDelay_s);
  double last_s = -1;
  while (!stop.stop_requested()) {
    auto sensed = feed.next();
    if (!sensed) continue;
    score(robot, *sensed, to_seconds(clock.now() - start),
          1e-9 * static_cast<double>(to_ns(start)));
    if (robot.late) sensed = other.pass(*sensed);
    if (!sensed) continue;
    const double dt = last_s < 0 ? 0.0 : sensed->at_s - last_s;
    last_s = sensed->at_s;
    robot.plant->command(cascade.update(sensed->p, sensed->v, dt));
  }
}

double rms_mm(double squares, long long samples) {
  return samples > 0 ? 1e3 * std::sqrt(squares / static_cast<double>(samples)) : NAN;
}

void print(const std::vector<Robot>& all) {
  std::printf("%-12s %-8s %-34s %16s %12s %18s\n", "robot", "gains", "fed by", "error RMS [mm]",
              "worst [mm]", "estimate RMS [mm]");
  for (const Robot& robot : all) {
    std::printf("%-12s %-8s %-34s ", robot.flies ? "quadrotor" : "treadmill",
                robot.stiff ? "stiff" : "soft",
                robot.late ? "50 ms late, velocity differenced" : "our stream, 200 Hz");
    if (robot.worst_m > kRoom_m) {
      std::printf("%16s\n", "unstable: left the room");
      continue;
    }
    std::printf("%16.1f %12.1f %18.1f\n", rms_mm(robot.squares, robot.samples), 1e3 * robot.worst_m,
                rms_mm(robot.sensed_squares, robot.samples));
  }
}

int run(double seconds) {
  std::vector<Robot> all = robots();
  const TemporaryFolder folder;
  const auto config = parse_config(config_text(all, folder.write("hall.yaml", survey())), "bench");
  if (!config) {
    std::fprintf(stderr, "%s\n", config.error().front().text().c_str());
    return 1;
  }
  std::uint64_t seed = 1;
  ServerOptions options;
  options.motion = [&](const std::string& name) -> std::unique_ptr<simulation::Trajectory> {
    for (Robot& robot : all) {
      if (robot.name != name) continue;
      // The same gusts for all of a kind.
      auto plant = robot.flies ? make_quadrotor(seed) : make_walker(seed);
      robot.plant = plant.get();
      return plant;
    }
    return nullptr;
  };
  const SystemClock clock;
  auto server = Server::build(*config, options, clock);
  if (!server) {
    std::fprintf(stderr, "%s\n", server.error().text().c_str());
    return 1;
  }
  std::jthread serving([&] { (void)(*server)->run(); });
  ClientOptions to_server;
  to_server.port = kPort;
  {
    const Client client(to_server);
    std::vector<std::jthread> loops;
    for (Robot& robot : all) {
      loops.emplace_back([&](std::stop_token stop) {
        control(robot, SdkFeed(client, robot.name), (*server)->simulation_start(), clock, stop);
      });
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    for (auto& loop : loops) loop.request_stop();
    loops.clear();
    print(all);
  }
  (*server)->stop();
  return 0;
}

}  // namespace
}  // namespace fiducap::loop

namespace fiducap::bench {

Bench add_loop(CLI::App&, const bool& quick) {
  return [&quick] {
    log::set_level(log::Level::kWarning);
    return loop::run(quick ? 15.0 : 60.0);
  };
}

}  // namespace fiducap::bench
