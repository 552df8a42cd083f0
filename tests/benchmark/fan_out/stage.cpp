#include "fan_out/stage.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cmath>
#include <ctime>
#include <fstream>
#include <iostream>
#include <memory>
#include <thread>

#include "base/handover.hpp"
#include "base/pose.hpp"
#include "daemon/system.hpp"
#include "streaming/native/native.hpp"
#include "streaming/natnet/natnet.hpp"
#include "streaming/qualisys/qualisys.hpp"
#include "streaming/streamer.hpp"
#include "streaming/vicon/vicon.hpp"
#include "streaming/vrpn/vrpn.hpp"

namespace fiducap::fan_out {
namespace {

std::int64_t resident_kB() {
  std::ifstream file("/proc/self/statm");
  std::int64_t all = 0;
  std::int64_t resident = 0;
  file >> all >> resident;
  return resident * 4;
}

std::shared_ptr<SceneModel> model_of(int bodies) {
  auto model = std::make_shared<SceneModel>();
  for (int k = 1; k <= bodies; ++k) model->bodies.push_back({k, "body" + std::to_string(k)});
  return model;
}

class Stage final {
 public:
  Stage(const Load& load, Shared& shared)
      : load_(load), shared_(shared), model_(model_of(load.bodies)), timer_(io_) {}

  int run() {
    if (!open()) return 1;
    shared_.ready = true;
    while (!shared_.go) io_.run_for(std::chrono::milliseconds(1));
    period_ = std::chrono::nanoseconds(std::llround(1e9 / load_.rate_hz));
    next_ = std::chrono::steady_clock::now() + std::chrono::milliseconds(20);
    shared_.first_at_ns = std::chrono::nanoseconds(next_.time_since_epoch()).count();
    const std::int64_t wall = shared_.first_at_ns;
    const std::clock_t cpu = std::clock();
    wait();
    io_.restart();
    io_.run();
    shared_.cpu_share = 1e9 * static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC /
                        static_cast<double>(to_ns(clock_.now()) - wall);
    return 0;
  }

 private:
  bool open() {
    vrpn::VrpnConfig vrpn;
    vrpn.port = 0;
    vrpn.acceleration = true;
    native::NativeConfig native;
    native.port = 0;
    natnet::NatNetConfig natnet;
    natnet.port = 0;
    natnet.multicast = false;
    natnet.bitstream = "4.1";
    vicon::ViconConfig vicon;
    vicon.port = 0;
    qualisys::QualisysConfig qualisys;
    qualisys.base_port = 0;
    qualisys.discovery_port = 0;
    shared_.utc_offset_ns = utc_offset().count();
    const ProtocolContext context{
        .io = io_, .model = model_, .clock = clock_, .rate_hz = load_.rate_hz};
    return serve(Shared::kVrpn, vrpn::serve(context, vrpn)) &&
           serve(Shared::kNative, native::serve(context, native)) &&
           serve(Shared::kNatNet, natnet::serve(context, natnet)) &&
           serve(Shared::kVicon, vicon::serve(context, vicon)) &&
           serve(Shared::kQualisys, qualisys::serve(context, qualisys));
  }

  template <typename Server>
  bool serve(Shared::Protocol protocol, Expected<Server> server) {
    if (!server) {
      std::cerr << server.error().text() << "\n";
      return false;
    }
    shared_.ports[protocol] = (*server)->port();
    hub_.add(std::move(*server));
    return true;
  }

  void wait() {
    timer_.expires_at(next_);
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) step();
    });
  }

  void step() {
    publish();
    next_ += period_;
    const auto all = static_cast<std::uint64_t>(load_.seconds * load_.rate_hz);
    if (number_ == all / 5) resident_at_first_ = resident_kB();
    if (number_ < all) return wait();
    shared_.memory_grown_kB = resident_kB() - resident_at_first_;
    hub_.stop();
    timer_.expires_after(std::chrono::milliseconds(100));
    timer_.async_wait([this](const boost::system::error_code&) { io_.stop(); });
  }

  void publish() {
    const auto frame = frames_.acquire();
    frame->number = ++number_;
    shared_.frames = number_;
    frame->at = Instant(std::chrono::nanoseconds(next_.time_since_epoch()));
    frame->published_at = clock_.now();
    frame->utc_offset = Duration{shared_.utc_offset_ns};
    frame->rate_hz = load_.rate_hz;
    frame->model = model_;
    frame->map = map_;
    frame->bodies.resize(model_->bodies.size());
    const double t_s = static_cast<double>(number_) / load_.rate_hz;
    for (std::size_t i = 0; i < frame->bodies.size(); ++i)
      place(static_cast<int>(i) + 1, t_s, frame->at, frame->bodies[i]);
    hub_.publish(frame);
  }

  static void place(int k, double t_s, Instant at, BodyPose& body) {
    body.body_id = k;
    body.valid = true;
    body.state = BodyState::kTracking;
    body.X_WP = {exp_so3({0, 0, 0.1 * k + t_s}), {0.1 * k, std::sin(t_s), 1.5}};
    body.v_WP = {0, std::cos(t_s), 0};
    body.w_WP_P = {0, 0, 1};
    body.a_WP = {0, -std::sin(t_s), 0};
    body.covariance = Matrix12d::Identity() * 1e-6;
    body.exposed_at = at - std::chrono::milliseconds(20);
    body.age = std::chrono::milliseconds(20);
    body.tags_in_view = 3;
  }

  Load load_;
  Shared& shared_;
  boost::asio::io_context io_{1};
  SystemClock clock_;
  std::shared_ptr<SceneModel> model_;
  std::shared_ptr<TagMap> map_{std::make_shared<TagMap>()};
  StreamHub hub_;
  ObjectPool<SceneFrame> frames_;
  boost::asio::steady_timer timer_;
  std::chrono::steady_clock::time_point next_;
  std::chrono::nanoseconds period_{};
  std::uint64_t number_{0};
  std::int64_t resident_at_first_{0};
};

}  // namespace

int run_stage(const Load& load, Shared& shared) {
  const int code = Stage(load, shared).run();
  if (code != 0) shared.failed = true;
  return code;
}

}  // namespace fiducap::fan_out
