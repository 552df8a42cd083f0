// Both ends of NatNet with poses known by construction, run by hand against programs that are not
// part of this project: `natnet_peer serve`, `natnet_peer receive` (--help lists the options).
//
// Body k (from 1) is called `body<k>`. In frame n it is at (0.01 k, 0.001 (n mod 1000), 1.5) in the
// workspace, turned by 0.01 k rad about (1, 2, 3). Body 3 is lost in every second hundred of
// frames.
#include <poll.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cmath>
#include <ctime>
#include <iostream>
#include <string>
#include <vector>

#include "base/bytes.hpp"
#include "base/pose.hpp"
#include "streaming/natnet/codec.hpp"
#include "streaming/natnet/natnet.hpp"
#include "support/real_clock.hpp"
#include "unit/streaming/natnet/messages.hpp"

namespace fiducap::natnet {
namespace {

namespace asio = boost::asio;
using asio::ip::udp;

std::int64_t read_ns(clockid_t id) {
  timespec t{};
  clock_gettime(id, &t);
  return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

std::int64_t now_ns() { return read_ns(CLOCK_MONOTONIC); }

bool is_valid(int k, std::uint64_t frame) { return k != 3 || frame / 100 % 2 == 0; }

struct ServeOptions {
  NatNetConfig config;
  int bodies{3};
  double rate_hz{100};
  double seconds{10};
};

class Stage final {
 public:
  Stage(asio::io_context& io, const Clock& clock, const ServeOptions& options,
        std::shared_ptr<SceneModel> model, NatNetStreamer& server)
      : timer_(io), clock_(clock), options_(options), server_(server) {
    frame_->rate_hz = options.rate_hz;
    frame_->bodies.resize(model->bodies.size());
    frame_->model = std::move(model);
  }
  void start() {
    next_ = std::chrono::steady_clock::now();
    step();
  }
  [[nodiscard]] std::uint64_t frames() const { return frame_->number; }

 private:
  void step() {
    ++frame_->number;
    frame_->at = frame_->published_at = clock_.now();
    for (std::size_t i = 0; i < frame_->bodies.size(); ++i)
      place(static_cast<int>(i) + 1, frame_->bodies[i]);
    server_.publish(frame_);
    if (static_cast<double>(frames()) >= options_.seconds * options_.rate_hz) {
      report();
      return server_.stop();
    }
    next_ += std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / options_.rate_hz));
    timer_.expires_at(next_);
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) step();
    });
  }
  void place(int k, BodyPose& body) const {
    body.body_id = k;
    body.valid = is_valid(k, frames());
    body.state = body.valid ? BodyState::kTracking : BodyState::kLost;
    body.X_WP = {exp_so3(Eigen::Vector3d(1, 2, 3).normalized() * 0.01 * k),
                 {0.01 * k, 0.001 * static_cast<double>(frames() % 1000), 1.5}};
    body.covariance = Matrix12d::Identity() * 1e-6;
  }
  void report() const {
    std::vector<ClientStatus> clients;
    server_.append_clients(clients);
    for (const auto& one : clients) {
      std::cout << one.peer << "  " << one.detail << "  sent " << one.frames_sent << "  dropped "
                << one.frames_dropped << '\n';
    }
  }

  asio::steady_timer timer_;
  const Clock& clock_;
  ServeOptions options_;
  NatNetStreamer& server_;
  std::shared_ptr<SceneFrame> frame_ = std::make_shared<SceneFrame>();
  std::chrono::steady_clock::time_point next_;
};

/// At the end it prints the sent frames and their CPU time.
int serve(const ServeOptions& options) {
  for (const auto& broken : options.config.check()) std::cerr << broken.text() << '\n';
  asio::io_context io{1};
  const RealClock clock;
  auto model = std::make_shared<SceneModel>();
  for (int k = 1; k <= options.bodies; ++k)
    model->bodies.push_back({k, "body" + std::to_string(k)});
  auto server = start_natnet_server(io, options.config, model, clock, nullptr, options.rate_hz);
  if (!server) {
    std::cerr << server.error().text() << '\n';
    return 1;
  }
  Stage stage(io, clock, options, model, **server);
  const auto wall = now_ns();
  const auto cpu = read_ns(CLOCK_PROCESS_CPUTIME_ID);
  stage.start();
  io.run();
  const double cpu_s = static_cast<double>(read_ns(CLOCK_PROCESS_CPUTIME_ID) - cpu) * 1e-9;
  const double wall_s = static_cast<double>(now_ns() - wall) * 1e-9;
  std::cout << stage.frames() << " frames in " << wall_s << " s, " << 100 * cpu_s / wall_s
            << " % of a core\n";
  return 0;
}

struct ReceiveOptions {
  std::string server{"127.0.0.1"};
  std::uint16_t port{1510};
  int bodies{1000};
  int seconds{10};
};

struct Tally {
  std::uint64_t frames{};
  std::uint64_t broken{};
  std::uint64_t lost{};
  std::uint64_t bodies{};
  std::int32_t last{-1};
  std::vector<std::int64_t> latency_ns;
};

/// A frame is whole when its sections add up to the datagram and every body is where `serve` put
/// it.
bool check(std::span<const std::byte> datagram, int bodies, Tally& tally) {
  constexpr double kFloat = 1e-5;  // f32 on the wire, metres of some tens
  LittleEndianReader in(datagram);
  const bool header = in.u16() == static_cast<std::uint16_t>(Message::kFrame) &&
                      in.u16() == datagram.size() - kHeaderSize;
  const std::int32_t number = in.i32();
  in.bytes(16);  // two empty sections
  const bool count = in.i32() == bodies && in.i32() == 38 * bodies;
  bool places = true;
  for (int k = 1; k <= bodies && !in.failed(); ++k) {
    const int id = in.i32();
    const float x = in.f32(), y = in.f32(), z = in.f32();
    in.bytes(20);  // quaternion, mean error
    const bool valid = in.i16() == 1;
    ++tally.bodies;
    const bool here = std::abs(x - 0.01 * k) < kFloat && std::abs(y - 1.5) < kFloat &&
                      std::abs(z + 0.001 * (number % 1000)) < kFloat;
    places = places && id == k && (here || !valid) &&
             valid == is_valid(k, static_cast<std::uint64_t>(number));
  }
  in.bytes(5 * 8 + 8 + 8);
  const std::int64_t mid_exposure = in.i64();
  in.bytes(8 + 8 + 8 + 2);
  const bool end = in.i32() == 0 && in.left() == 0 && !in.failed();
  tally.latency_ns.push_back(
      now_ns() - mid_exposure * static_cast<std::int64_t>(1'000'000'000 / kClockFrequency));
  if (tally.last >= 0)
    tally.lost += static_cast<std::uint64_t>(std::max(0, number - tally.last - 1));
  tally.last = number;
  return header && count && places && end;
}

Tally receive_frames(const ReceiveOptions& options) {
  asio::io_context io;
  udp::socket socket(io, udp::endpoint(udp::v4(), 0));
  socket.set_option(asio::socket_base::receive_buffer_size(8 << 20));
  const udp::endpoint server(asio::ip::make_address(options.server), options.port);
  const Bytes keep_alive = message(Message::kKeepAlive);
  socket.send_to(asio::buffer(connect({4, 1}, {4, 1})), server);
  socket.send_to(asio::buffer(keep_alive), server);
  Tally tally;
  std::vector<std::byte> buffer(65536);
  const std::int64_t start = now_ns();
  std::int64_t asked = start;
  while (now_ns() - start < options.seconds * std::int64_t{1'000'000'000}) {
    if (now_ns() - asked > 1'000'000'000) {
      socket.send_to(asio::buffer(keep_alive), server);
      asked = now_ns();
    }
    pollfd wait{socket.native_handle(), POLLIN, 0};
    if (::poll(&wait, 1, 100) <= 0) continue;
    udp::endpoint from;
    const auto size = socket.receive_from(asio::buffer(buffer), from);
    if (from == server) continue;  // an answer
    ++tally.frames;
    if (!check(std::span<const std::byte>(buffer).first(size), options.bodies, tally))
      ++tally.broken;
  }
  return tally;
}

/// A strict unicast NatNet 4.1 client: checks every byte that it understands, and measures.
int receive(const ReceiveOptions& options) {
  const std::int64_t start = now_ns();
  Tally tally = receive_frames(options);
  if (tally.frames == 0) {
    std::cout << "no frame received\n";
    return 1;
  }
  auto& latency = tally.latency_ns;
  std::sort(latency.begin(), latency.end());
  const double seconds = static_cast<double>(now_ns() - start) * 1e-9;
  std::cout << tally.frames << " frames in " << seconds << " s, " << tally.lost << " lost, "
            << tally.broken << " broken; " << tally.bodies << " bodies; latency p50 "
            << latency[latency.size() / 2] / 1000 << " us, p99 "
            << latency[latency.size() * 99 / 100] / 1000 << " us, max " << latency.back() / 1000
            << " us\n";
  return tally.lost + tally.broken == 0 ? 0 : 1;
}

int run(int argc, char** argv) {
  CLI::App app("NatNet with poses known by construction.");
  app.option_defaults()->always_capture_default();
  app.require_subcommand(1);
  ServeOptions out;
  out.config.multicast = false;
  CLI::App& serving = *app.add_subcommand("serve", "A server.");
  serving.add_option("--address", out.config.address);
  serving.add_option("--unicast", out.config.unicast);
  serving.add_option("--port", out.config.port);
  serving.add_option("--data-port", out.config.data_port);
  serving.add_option("--multicast", out.config.multicast);
  serving.add_option("--bitstream", out.config.bitstream);
  serving.add_option("--target", out.config.targets, "ADDRESS:PORT");
  serving.add_flag_callback("--z-up", [&] { out.config.up = UpAxis::kZ; });
  serving.add_option("--bodies", out.bodies);
  serving.add_option("--rate", out.rate_hz);
  serving.add_option("--seconds", out.seconds);
  ReceiveOptions in;
  CLI::App& receiving = *app.add_subcommand("receive", "A client of `serve`.");
  receiving.add_option("--server", in.server);
  receiving.add_option("--port", in.port);
  receiving.add_option("--bodies", in.bodies);
  receiving.add_option("--seconds", in.seconds);
  CLI11_PARSE(app, argc, argv);
  return serving.parsed() ? serve(out) : receive(in);
}

}  // namespace
}  // namespace fiducap::natnet

int main(int argc, char** argv) { return fiducap::natnet::run(argc, argv); }
