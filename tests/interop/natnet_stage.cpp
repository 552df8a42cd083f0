// A NatNet server with poses known by construction, for clients that are not part of this project:
//
//   natnet_stage [address=127.0.0.1] [unicast=1] [port=1510] [data_port=1511]
//                [multicast=0] [bodies=3] [rate=100] [seconds=10] [bitstream=3.1] [up=y]
//                [target=ip:port]
//
// Body k (from 1) is called `body<k>`. In frame n it is at (0.01 k, 0.001 (n mod 1000), 1.5) in the
// workspace, turned by 0.01 k rad about (1, 2, 3). Body 3 is lost in every second hundred of
// frames. At the end: what was sent, and the CPU time it took.
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <iostream>
#include <string>
#include <string_view>

#include "base/pose.hpp"
#include "key_values.hpp"
#include "streaming/natnet/natnet.hpp"

namespace fiducap {
namespace {

class MonotonicClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const override { return instant_from_ns(read_ns(CLOCK_MONOTONIC)); }
  [[nodiscard]] bool wait_until(Instant, std::stop_token) const override { return false; }
};

struct Script {
  int bodies{3};
  double rate_hz{100};
  double seconds{10};
};

std::shared_ptr<SceneModel> make_model(int bodies) {
  auto model = std::make_shared<SceneModel>();
  for (int k = 1; k <= bodies; ++k) model->bodies.push_back({k, "body" + std::to_string(k)});
  return model;
}

class Stage final {
 public:
  Stage(boost::asio::io_context& io, const Clock& clock, const Script& script,
        std::shared_ptr<SceneModel> model, natnet::NatNetStreamer& server)
      : timer_(io), clock_(clock), script_(script), model_(std::move(model)), server_(server) {}

  void start() {
    next_ = std::chrono::steady_clock::now();
    step();
  }
  [[nodiscard]] std::uint64_t frames() const { return number_; }

 private:
  void step() {
    publish();
    next_ += std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / script_.rate_hz));
    if (static_cast<double>(number_) >= script_.seconds * script_.rate_hz) return server_.stop();
    timer_.expires_at(next_);
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) step();
    });
  }
  void publish() {
    frame_->number = ++number_;
    frame_->at = clock_.now();
    frame_->published_at = frame_->at;
    frame_->rate_hz = script_.rate_hz;
    frame_->model = model_;
    frame_->bodies.resize(model_->bodies.size());
    for (std::size_t i = 0; i < frame_->bodies.size(); ++i)
      place(static_cast<int>(i) + 1, frame_->bodies[i]);
    server_.publish(frame_);
    report();
  }
  void place(int k, BodyPose& body) const {
    body.body_id = k;
    body.valid = k != 3 || number_ / 100 % 2 == 0;
    body.state = body.valid ? BodyState::kTracking : BodyState::kLost;
    body.X_WP = {exp_so3(Eigen::Vector3d(1, 2, 3).normalized() * 0.01 * k),
                 {0.01 * k, 0.001 * static_cast<double>(number_ % 1000), 1.5}};
    body.covariance = Matrix12d::Identity() * 1e-6;
  }
  void report() const {
    if (static_cast<double>(number_) < script_.seconds * script_.rate_hz) return;
    std::vector<ClientStatus> clients;
    server_.append_clients(clients);
    for (const auto& one : clients) {
      std::cout << one.peer << "  " << one.detail << "  sent " << one.frames_sent << "  dropped "
                << one.frames_dropped << '\n';
    }
  }

  boost::asio::steady_timer timer_;
  const Clock& clock_;
  Script script_;
  std::shared_ptr<SceneModel> model_;
  natnet::NatNetStreamer& server_;
  std::shared_ptr<SceneFrame> frame_ = std::make_shared<SceneFrame>();
  std::uint64_t number_{0};
  std::chrono::steady_clock::time_point next_;
};

int run(const KeyValues& given) {
  const Script script{static_cast<int>(given.number("bodies", 3)), given.number("rate", 100),
                      given.number("seconds", 10)};
  natnet::NatNetConfig config;
  config.address = given.text("address", config.address);
  config.unicast = given.number("unicast", 1) != 0;
  config.port = static_cast<std::uint16_t>(given.number("port", config.port));
  config.data_port = static_cast<std::uint16_t>(given.number("data_port", config.data_port));
  config.multicast = given.number("multicast", 0) != 0;
  config.bitstream = given.text("bitstream", config.bitstream);
  if (given.has("target")) config.targets = {given.text("target")};
  if (given.text("up") == "z") config.up = UpAxis::kZ;
  for (const auto& broken : config.check()) std::cerr << broken.text() << '\n';
  boost::asio::io_context io{1};
  const MonotonicClock clock;
  const auto model = make_model(script.bodies);
  auto server = natnet::start_natnet_server(io, config, model, clock, nullptr, script.rate_hz);
  if (!server) {
    std::cerr << server.error().text() << '\n';
    return 1;
  }
  Stage stage(io, clock, script, model, **server);
  const auto wall = read_ns(CLOCK_MONOTONIC);
  const auto cpu = read_ns(CLOCK_PROCESS_CPUTIME_ID);
  stage.start();
  io.run();
  const double cpu_s = static_cast<double>(read_ns(CLOCK_PROCESS_CPUTIME_ID) - cpu) * 1e-9;
  const double wall_s = static_cast<double>(read_ns(CLOCK_MONOTONIC) - wall) * 1e-9;
  std::cout << stage.frames() << " frames in " << wall_s << " s, " << 100 * cpu_s / wall_s
            << " % of a core\n";
  return 0;
}

}  // namespace
}  // namespace fiducap

int main(int argc, char** argv) {
  fiducap::KeyValues given;
  return given.parse(argc, argv) ? fiducap::run(given) : 2;
}
