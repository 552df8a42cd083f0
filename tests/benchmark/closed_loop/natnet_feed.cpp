#include "closed_loop/natnet_feed.hpp"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <vector>

#include "base/bytes.hpp"

namespace fiducap::loop {

namespace {

constexpr std::uint16_t kFrame = 7;
constexpr std::uint16_t kKeepAlive = 10;
constexpr int kConnectSize = 269;
constexpr double kLowPass_s = 0.03;
constexpr double kTicks_1_s = 1e7;

std::int64_t steady_ns() {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::vector<std::byte> message(std::uint16_t id, std::uint16_t size) {
  std::vector<std::byte> bytes(4 + std::size_t{size});
  std::memcpy(bytes.data(), &id, 2);
  std::memcpy(bytes.data() + 2, &size, 2);
  return bytes;
}

}  // namespace

NatNetFeed::NatNetFeed(std::uint16_t port, std::int32_t body_id)
    : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)), body_id_(body_id), port_(port) {
  auto connect = message(0, kConnectSize);
  std::memcpy(connect.data() + 4, "closed_loop", 11);
  const std::array<unsigned char, 9> versions{4, 1, 0, 0, 0,
                                              4, 1, 0, 0};  // NatNet, subscription, bitstream
  std::memcpy(connect.data() + 4 + 256 + 4, versions.data(), versions.size());
  sockaddr_in server{};
  server.sin_family = AF_INET;
  server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  server.sin_port = htons(port_);
  ::sendto(socket_, connect.data(), connect.size(), 0, reinterpret_cast<const sockaddr*>(&server),
           sizeof server);
  keep_alive();
}

NatNetFeed::~NatNetFeed() { ::close(socket_); }

void NatNetFeed::keep_alive() {
  const std::int64_t now = steady_ns();
  if (now - spoke_ns_ < 1'000'000'000) return;
  spoke_ns_ = now;
  const auto alive = message(kKeepAlive, 0);
  sockaddr_in server{};
  server.sin_family = AF_INET;
  server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  server.sin_port = htons(port_);
  ::sendto(socket_, alive.data(), alive.size(), 0, reinterpret_cast<const sockaddr*>(&server),
           sizeof server);
}

std::optional<Sensed> NatNetFeed::next() {
  keep_alive();
  pollfd wait{socket_, POLLIN, 0};
  std::array<std::byte, 65536> buffer{};
  if (::poll(&wait, 1, 100) != 1) return std::nullopt;
  const ssize_t size = ::recv(socket_, buffer.data(), buffer.size(), 0);
  if (size < 4) return std::nullopt;
  LittleEndianReader in(std::span<const std::byte>(buffer).first(static_cast<std::size_t>(size)));
  if (in.u16() != kFrame) return std::nullopt;
  in.bytes(2 + 4 + 16);  // size, number, two empty sections
  const int bodies = in.i32();
  in.i32();
  std::optional<Eigen::Vector3d> p;
  for (int i = 0; i < bodies && !in.failed(); ++i) {
    const bool mine = in.i32() == body_id_;
    const double x = in.f32(), y = in.f32(), z = in.f32();
    in.bytes(16 + 4);
    const bool tracked = (in.i16() & 1) != 0;
    if (mine && tracked) p = Eigen::Vector3d(x, y, z);
  }
  in.bytes(5 * 8 + 8 + 8);  // five empty sections, timecode, seconds since the server's start
  const double at_s = static_cast<double>(in.i64()) / kTicks_1_s;
  if (!p || in.failed()) return std::nullopt;
  Sensed sensed{at_s, *p, Eigen::Vector3d::Zero()};
  if (last_ && at_s > last_->at_s) {
    const double dt = at_s - last_->at_s;
    const double share = dt / (kLowPass_s + dt);
    sensed.v = last_->v + share * ((*p - last_->p) / dt - last_->v);
  }
  last_ = sensed;
  return sensed;
}

}  // namespace fiducap::loop
