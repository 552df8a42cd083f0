// The page's server with three fake robots in a fake hall of 24 tags, for the browser tests and for
// work on the page:
//   page_test_server [--port N] [--root FOLDER] [--bodies N] [--trouble 1]
//                    [--store FOLDER [--token TOKEN]] [--cameras loopback|operator|everyone|off]
// With a folder for the store the map is a real one, which the token permits to change.
// Prints the port, serves until its input ends. Lines of the input are commands:
//   begin SUBJECT KIND TEXT…  begins a condition, with a remedy; `end SUBJECT KIND` ends it.
//   pictures  prints the number of the cameras' pictures
#include <unistd.h>
#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <istream>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>

#include <boost/asio/read_until.hpp>
#include <boost/asio/streambuf.hpp>

#include "base/event_board.hpp"
#include "base/log.hpp"
#include "base/pose.hpp"
#include "daemon/operator_service.hpp"
#include "daemon/system.hpp"
#include "fake_cameras.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/web/web.hpp"
#include "support/fake_operator_api.hpp"
#include "support/real_clock.hpp"

namespace {

using namespace fiducap;
using namespace std::chrono_literals;

constexpr auto kPeriod = 10ms;

// Columns of the attitude: directions of the tag's x, y and z (out of the print) in the hall.
Pose facing(const Eigen::Vector3d& out, const Eigen::Vector3d& up, const Eigen::Vector3d& p) {
  Eigen::Matrix3d R;
  R << up.cross(out), up, out;
  return {Eigen::Quaterniond(R), p};
}

MapTag tag(int id, const Pose& X_WT) {
  MapTag made;
  made.tag.tag_id = id;
  made.tag.edge_m = id < 8 ? 0.4 : 0.25;
  made.tag.X_WT = X_WT;
  made.tag.covariance = Matrix6d::Identity() * (id < 18 ? 4e-6 : 4e-4);
  made.state = id < 4 ? TagState::kSurveyed : id < 18 ? TagState::kCalibrated : TagState::kLocal;
  if (id == 23) made.state = TagState::kQuarantined;
  made.sightings = 40 * (24 - id);
  return made;
}

// A hall of 10 m × 6 m: eight tags on the floor, sixteen on the four walls.
std::shared_ptr<const TagMap> hall() {
  auto map = std::make_shared<TagMap>();
  map->version = 12;
  map->reference_tag = 0;
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  const auto add = [&](int id, const Eigen::Vector3d& out, const Eigen::Vector3d& up,
                       const Eigen::Vector3d& p) {
    map->tags.push_back(tag(id, facing(out, up, p)));
  };
  for (int i = 0; i < 8; ++i) add(i, z, y, {-3.6 + 2.4 * (i % 4), i < 4 ? -1.2 : 1.2, 0});
  for (int i = 0; i < 5; ++i) {
    add(8 + i, y, z, {-4 + 2.0 * i, -3, 1.2 + 0.3 * (i % 2)});
    add(13 + i, -y, z, {-4 + 2.0 * i, 3, 1.4 - 0.3 * (i % 2)});
  }
  for (int i = 0; i < 3; ++i) {
    add(18 + i, x, z, {-5, -1.8 + 1.8 * i, 1.3});
    add(21 + i, -x, z, {5, -1.8 + 1.8 * i, 1.3});
  }
  std::sort(map->tags.begin(), map->tags.end(),
            [](const auto& a, const auto& b) { return a.tag.tag_id < b.tag.tag_id; });
  return map;
}

BodyPose body(int index, double t) {
  BodyPose made;
  made.body_id = index + 1;
  const double radius = 1.2 + 0.55 * (index % 3);
  const double rate = (index % 2 == 0 ? 0.35 : -0.28) * (1 + 0.1 * index);
  const double phase = rate * t + index;
  made.state = BodyState::kTracking;
  made.valid = true;
  made.X_WP.p = {1.6 * radius * std::cos(phase), radius * std::sin(phase),
                 index == 1 ? 1.3 + 0.3 * std::sin(0.7 * t) : 0.35};
  made.v_WP = {-1.6 * radius * rate * std::sin(phase), radius * rate * std::cos(phase),
               index == 1 ? 0.21 * std::cos(0.7 * t) : 0};
  made.X_WP.q = exp_so3({0, 0, std::atan2(made.v_WP.y(), made.v_WP.x())});
  if (index == 1) made.X_WP.q = made.X_WP.q * exp_so3({0.25 * std::sin(1.3 * t), 0.1, 0});
  made.w_WP_P = {0, 0, rate};
  const double sigma = 0.002 + 0.001 * index + 0.0006 * std::sin(2 * t + index);
  made.covariance.topLeftCorner<3, 3>() =
      Eigen::Vector3d(sigma * sigma, 0.5 * sigma * sigma, 0.25 * sigma * sigma).asDiagonal();
  made.covariance.block<3, 3>(3, 3) = Eigen::Matrix3d::Identity() * 4e-6;
  made.age =
      std::chrono::milliseconds(12 + static_cast<int>(20 * (0.5 + 0.5 * std::sin(9 * t + index))));
  made.tags_in_view = 4 + static_cast<int>(2 * std::sin(t + index));
  made.image_rate_hz = 20.0 - 0.1 * index;
  made.reprojection_px = 0.21 + 0.05 * index;
  made.processing =
      std::chrono::microseconds(7200 + 900 * index + static_cast<int>(800 * std::sin(3 * t)));
  return made;
}

// The third robot sometimes drives without tags: it coasts, is lost, and tracks again.
void lose_sometimes(BodyPose& made, double t) {
  const double within = std::fmod(t, 40.0);
  if (within < 22) return;
  made.tags_in_view = 0;
  made.age = from_seconds(within - 22);
  made.state = within < 30   ? BodyState::kCoasting
               : within < 36 ? BodyState::kLost
                             : BodyState::kTracking;
  made.valid = made.state != BodyState::kLost;
  if (made.state == BodyState::kCoasting)
    made.covariance.topLeftCorner<6, 6>() *= 1 + 40 * (within - 22);
}

// The second robot was never placed, the third remains lost.
void trouble(std::vector<BodyPose>& bodies) {
  for (std::size_t i = 1; i < std::min<std::size_t>(bodies.size(), 3); ++i) {
    if (i == 1) bodies[i] = BodyPose{.body_id = bodies[i].body_id};
    bodies[i].valid = false;
    bodies[i].state = i == 1 ? BodyState::kSearching : BodyState::kLost;
    bodies[i].tags_in_view = 0;
  }
}

/// The map of a server as in fiducapd, with its store and its operator, without bodies. It is
/// stored by commands only.
class ServedMap final {
 public:
  ServedMap(TagMap start, const std::string& folder, std::string token, EventBoard& events)
      : map_(MapConfig{}, std::move(start)),
        keeper_(MapStore::open(folder + "/map.sqlite").value(), map_, kNever_s, clock_, events,
                [] { return std::vector<LearnedBody>{}; }),
        recorder_(RecorderConfig{folder, false}, clock_, events),
        access_({.token = std::move(token)}, events, clock_),
        service_(access_, scene_, map_, recorder_, events, &keeper_),
        keeping_([this](std::stop_token stop) { keeper_.run(stop); }) {}

  [[nodiscard]] std::shared_ptr<const TagMap> snapshot() const { return map_.snapshot(); }
  [[nodiscard]] OperatorApi& service() { return service_; }

 private:
  static constexpr double kNever_s = 1e6;

  SystemClock clock_;
  Scene scene_{std::vector<SceneBody>{}};
  MapBuilder map_;
  MapKeeper keeper_;
  SessionRecorder recorder_;
  AccessKeeper access_;
  OperatorService service_;
  std::jthread keeping_;
};

class Hall final {
 public:
  /// @param map  nullptr: one that never changes
  Hall(boost::asio::io_context& io, Streamer& server, std::shared_ptr<const SceneModel> model,
       bool troubled, const ServedMap* map, FakeCameras& cameras)
      : timer_(io),
        server_(server),
        model_(std::move(model)),
        served_(map),
        cameras_(cameras),
        troubled_(troubled) {}

  void run() {
    timer_.expires_after(kPeriod);
    timer_.async_wait([this](boost::system::error_code error) {
      if (error || stopped_) return;
      publish();
      run();
    });
  }
  void stop() {
    // Cancelling alone misses a tick that is already in the loop.
    stopped_ = true;
    timer_.cancel();
  }

 private:
  void publish() {
    auto frame = std::make_shared<SceneFrame>();
    frame->number = ++number_;
    frame->at = frame->published_at = clock_.now();
    frame->utc_offset =
        std::chrono::system_clock::now().time_since_epoch() - frame->at.time_since_epoch();
    frame->rate_hz = 100;
    frame->model = model_;
    frame->map = served_ != nullptr ? room_.set_map(served_->snapshot()) : map_;
    const double t = static_cast<double>(number_) * to_seconds(kPeriod);
    for (std::size_t i = 0; i < model_->bodies.size(); ++i) {
      frame->bodies.push_back(body(static_cast<int>(i), t));
      if (i == 2) lose_sometimes(frame->bodies.back(), t);
    }
    if (troubled_) trouble(frame->bodies);
    if (number_ % 700 == 0)
      log::info("mapping", "tag " + std::to_string(number_ / 700 % 24) + " refined");
    if (number_ % 2300 == 0) log::warning("capture", "drone: image 31 ms late, dropped");
    server_.publish(frame);
    if (number_ % 10 == 0) cameras_.expose();
  }

  RealClock clock_;
  boost::asio::steady_timer timer_;
  Streamer& server_;
  std::shared_ptr<const SceneModel> model_;
  const ServedMap* served_;
  RoomAxes room_;
  FakeCameras& cameras_;
  std::shared_ptr<const TagMap> map_{hall()};
  std::uint64_t number_{0};
  bool troubled_;
  bool stopped_{false};
};

std::shared_ptr<const SceneModel> robots(int count) {
  auto model = std::make_shared<SceneModel>();
  const char* names[] = {"anymal", "drone", "cart"};
  for (int i = 0; i < count; ++i)
    model->bodies.push_back({i + 1, i < 3 ? names[i] : "robot_" + std::to_string(i + 1)});
  return model;
}

// Tag 9 has a bad fit, tag 23 an old one.
std::vector<TagFit> fits(Instant now) {
  std::vector<TagFit> all;
  for (int id = 0; id < 24; ++id)
    all.push_back({id, id == 9 ? 2.75 : 0.2 + 0.01 * id, 40, now - (id == 23 ? 2h : 0s)});
  return all;
}

void execute(std::istream& line, EventBoard& events, const CameraPreview& views) {
  std::string command, subject, kind, text;
  line >> command >> subject >> kind >> std::ws;
  std::getline(line, text);
  if (command == "begin") {
    events.begin({.severity = Severity::kError,
                  .subject = subject,
                  .kind = kind,
                  .text = text,
                  .remedy = "Do something about it"});
  }
  if (command == "end") events.end(subject, kind, "it is over");
  if (command != "pictures") return;
  std::printf("%llu\n", static_cast<unsigned long long>(views.pictures()));
  std::fflush(stdout);
}

/// Twelve versions of the map, and the fits of its tags; no token.
class FakeOperator final : public FakeOperatorApi {
 public:
  explicit FakeOperator(const Clock& clock) : clock_(clock) {
    operator_token.clear();
    mode = MapMode::kMapping;
  }
  [[nodiscard]] std::vector<MapVersionInfo> map_versions() const override {
    const std::int64_t now_ns = 1'790'000'000'000'000'000;
    std::vector<MapVersionInfo> all{
        {12, 11, now_ns, "c", "mapped by fiducapd", 24},
        {11, 10, now_ns - 60'000'000'000, "b", "before <the> move", 23}};
    for (int i = 10; i > 0; --i)
      all.push_back({i, i - 1, now_ns - (13 - i) * 60'000'000'000, "a", "", 20});
    return all;
  }
  [[nodiscard]] Expected<std::shared_ptr<const TagMap>> map_version(
      std::int64_t version) const override {
    auto map = std::make_shared<TagMap>(*hall());
    map->version = version;
    if (version == 12) return map;
    map->tags.erase(map->tags.begin() + 20);
    map->tags[9].tag.X_WT.p += Eigen::Vector3d(0.3, 0, 0.4);
    return map;
  }
  [[nodiscard]] std::vector<TagFit> tag_fits() const override { return fits(clock_.now()); }

 private:
  const Clock& clock_;
};

}  // namespace

int main(int argc, char** argv) {
  web::WebConfig config;
  config.port = 0;
  int bodies = 3;
  bool troubled = false;
  std::string store, token;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string_view option = argv[i];
    if (option == "--port") config.port = static_cast<std::uint16_t>(std::atoi(argv[i + 1]));
    if (option == "--store") store = argv[i + 1];
    if (option == "--token") token = argv[i + 1];
    if (option == "--root") config.root = argv[i + 1];
    if (option == "--trouble") troubled = std::string_view(argv[i + 1]) == "1";
    for (const auto& word : web::kViewRules)
      if (option == "--cameras" && word.text == argv[i + 1]) config.camera_views = word.value;
    if (option == "--bodies") bodies = std::atoi(argv[i + 1]);
  }
  boost::asio::io_context io;
  const RealClock clock;
  const auto model = robots(bodies);
  FakeCameras cameras(bodies, clock);
  std::unique_ptr<Streamer> server;
  EventBoard events(utc_now_ns);
  FakeOperator fake(clock);
  ProtocolContext context{io, model, clock, &fake, &events};
  context.version = "0.1.0";
  context.views = &cameras.preview();
  std::optional<ServedMap> served;
  if (!store.empty())
    context.operator_api = &served.emplace(*hall(), store, token, events).service();
  context.clients = [&] {
    const double up = std::fmod(to_seconds(clock.now().time_since_epoch()), 5000);
    const auto sent = static_cast<std::uint64_t>(up * 100);
    std::vector<ClientStatus> all{
        {"vrpn", "192.168.1.20:41522 udp", "z-up m, velocity on", sent, 0, up},
        {"vrpn", "192.168.1.31:50212 tcp", "z-up m", sent, 214, up / 2},
        {"native", "127.0.0.1:39011 udp", "3 bodies", sent * 2, 0, up}};
    server->append_clients(all);
    return all;
  };
  auto started = web::serve(context, config);
  if (!started) {
    std::fprintf(stderr, "%s\n", started.error().text().c_str());
    return 1;
  }
  server = std::move(*started);
  std::printf("%d\n", server->port());
  std::fflush(stdout);

  Hall hall(io, *server, model, troubled, served ? &*served : nullptr, cameras);
  hall.run();
  boost::asio::posix::stream_descriptor input(io, ::dup(STDIN_FILENO));
  boost::asio::streambuf buffer;
  std::function<void()> read = [&] {
    boost::asio::async_read_until(input, buffer, '\n',
                                  [&](boost::system::error_code error, std::size_t) {
                                    if (!error) {
                                      std::istream lines(&buffer);
                                      std::string text;
                                      std::getline(lines, text);
                                      std::istringstream line(text);
                                      execute(line, events, cameras.preview());
                                      return read();
                                    }
                                    hall.stop();
                                    server->stop();
                                  });
  };
  read();
  io.run();
  return 0;
}
