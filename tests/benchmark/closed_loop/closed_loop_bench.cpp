// fiducap_loop_bench [--quick]: control loops whose only feedback is our stream, over real sockets,
// in real time. The paper's experiment "Estimation in Closed Loop Control": a robot on a treadmill;
// and a quadrotor that hovers.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

#include "base/log.hpp"
#include "closed_loop/cascade.hpp"
#include "closed_loop/feedback.hpp"
#include "closed_loop/natnet_feed.hpp"
#include "closed_loop/plant.hpp"
#include "daemon/server.hpp"
#include "daemon/system.hpp"
#include "fiducap/client.hpp"
#include "mapping/formats/map_format.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap::loop {
namespace {

using namespace std::chrono_literals;

constexpr double kSettle_s = 8.0;  // after the first pose: the map grows, the loop finds its place
constexpr double kOtherDelay_s = 0.05;
constexpr double kRoom_m = 4.0;  // from the middle to the nearest wall
constexpr std::uint16_t kPort = 42618;
constexpr std::uint16_t kNatNetPort = 42619;

/// The demo's hall, corners instead of images so that four robots fit on two cores.
constexpr const char* kBody = R"(
    source: {type: simulator, camera: {images: false, corner_noise_px: 0.4}}
    cameras:
      - model: {width: 752, height: 480, fu: 460, fv: 460, cu: 376, cv: 240}
        X_BV: {p: [0.1, 0, 0], q_wxyz: [0.5, -0.5, 0.5, -0.5]}
        rate_hz: 20
)";

enum class Feed { kSdk, kNatNet, kOther };

constexpr const char* text_of(Feed feed) {
  switch (feed) {
    case Feed::kSdk:
      return "our stream, 200 Hz, SDK";
    case Feed::kNatNet:
      return "our stream, 200 Hz, NatNet 4.1";
    case Feed::kOther:
      return "50 ms late, velocity differenced";
  }
  return "";
}

struct Robot {
  const char* name;
  bool flies;
  Feed feed;
  bool stiff;
  Eigen::Vector3d target;
  Plant* plant{};  ///< Lives in the server's simulator.
  double squares{};
  double worst_m{};
  long long samples{};
  double sensed_squares{};  ///< Of the streamed position against the truth at its instant.
};

std::vector<Robot> robots() {
  return {{"treadmill", false, Feed::kSdk, true, {0, 0, 0}},
          {"treadmill-other", false, Feed::kOther, true, {0, 0, 0}},
          {"quadrotor", true, Feed::kSdk, false, {0, 0, 1.4}},
          {"quadrotor-natnet", true, Feed::kNatNet, false, {0, 0, 1.4}},
          {"quadrotor-other", true, Feed::kOther, false, {0, 0, 1.4}},
          {"quadrotor-stiff", true, Feed::kSdk, true, {0, 0, 1.4}},
          {"quadrotor-stiff-other", true, Feed::kOther, true, {0, 0, 1.4}}};
}

/// A surveyed, frozen map: how a control loop should be run.
std::string config_text(const std::vector<Robot>& all, const std::string& map_file) {
  std::string text =
      "tags: {size_m: 0.4}\nsimulation: {preset: hall}\nmap: {mode: frozen, file: " + map_file +
      "}\nstreaming: {rate_hz: 200, vrpn: {enabled: false}, web: {enabled: false}, native: "
      "{port: " +
      std::to_string(kPort) +
      "}, natnet: {enabled: true, up: z, multicast: false, port: " + std::to_string(kNatNetPort) +
      ", data_port: 0}}\nbodies:\n";
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

/// What comes by the SDK about one robot.
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

/// How far the robot is from where it should be, and the stream from the robot, now that both have
/// settled.
void judge(Robot& robot, const Sensed& sensed, double now_s, double start_s) {
  if (robot.plant->free_for() < kSettle_s) return;
  Eigen::Vector3d error = robot.plant->at(now_s).X_WB.p - robot.target;
  if (!robot.flies) error.z() = 0;  // the gait's, nobody controls it
  robot.squares += error.squaredNorm();
  robot.worst_m = std::max(robot.worst_m, error.norm());
  robot.sensed_squares += (robot.plant->at(sensed.at_s - start_s).X_WB.p - sensed.p).squaredNorm();
  ++robot.samples;
}

/// One controller: follows its feed until it is told to stop.
template <typename AnyFeed>
void control(Robot& robot, AnyFeed feed, Instant start, const Clock& clock, std::stop_token stop) {
  Cascade cascade(robot.stiff ? kStiff : kSoft, robot.target);
  LateAndDifferenced other(kOtherDelay_s);
  double last_s = -1;
  while (!stop.stop_requested()) {
    auto sensed = feed->next();
    if (!sensed) continue;
    judge(robot, *sensed, to_seconds(clock.now() - start),
          1e-9 * static_cast<double>(to_ns(start)));
    if (robot.feed == Feed::kOther) sensed = other.pass(*sensed);
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
                robot.stiff ? "stiff" : "soft", text_of(robot.feed));
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
      auto plant = robot.flies ? make_quadrotor(seed)
                               : make_walker(seed);  // the same gusts for both of a kind
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
    int id = 0;
    for (Robot& robot : all) {
      ++id;
      loops.emplace_back([&, id](std::stop_token stop) {
        const Instant start = (*server)->simulation_start();
        if (robot.feed == Feed::kNatNet) {
          control(robot, std::make_unique<NatNetFeed>(kNatNetPort, id), start, clock, stop);
        } else {
          control(robot, std::make_unique<SdkFeed>(client, robot.name), start, clock, stop);
        }
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

int main(int argc, char** argv) {
  fiducap::log::set_level(fiducap::log::Level::kWarning);
  const bool quick = argc == 2 && std::strcmp(argv[1], "--quick") == 0;
  if (argc > 1 && !quick) {
    std::fprintf(stderr, "usage: fiducap_loop_bench [--quick]\n");
    return 2;
  }
  return fiducap::loop::run(quick ? 15.0 : 60.0);
}
