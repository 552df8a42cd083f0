#include <poll.h>

#include <array>
#include <chrono>
#include <vector>

#include "base/bytes.hpp"
#include "closed_loop/feeds.hpp"
#include "support/loopback_socket.hpp"
#include "unit/streaming/natnet/messages.hpp"

namespace fiducap::loop {

namespace {

constexpr double kLowPass_s = 0.03;
constexpr double kTicks_1_s = 1e7;

std::int64_t steady_ns() {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

NatNetFeed::NatNetFeed(std::uint16_t port, std::int32_t body_id)
    : socket_(bound_socket(SOCK_DGRAM)), body_id_(body_id), port_(port) {
  send_datagram(socket_, natnet::connect({4, 1}, {4, 1}), port_);
  keep_alive();
}

NatNetFeed::~NatNetFeed() { ::close(socket_); }

void NatNetFeed::keep_alive() {
  const std::int64_t now = steady_ns();
  if (now - sent_ns_ < 1'000'000'000) return;
  sent_ns_ = now;
  send_datagram(socket_, natnet::message(natnet::Message::kKeepAlive), port_);
}

std::optional<Sensed> NatNetFeed::next() {
  keep_alive();
  pollfd wait{socket_, POLLIN, 0};
  std::array<std::byte, 65536> buffer{};
  if (::poll(&wait, 1, 100) != 1) return std::nullopt;
  const ssize_t size = ::recv(socket_, buffer.data(), buffer.size(), 0);
  if (size < 4) return std::nullopt;
  LittleEndianReader in(std::span<const std::byte>(buffer).first(static_cast<std::size_t>(size)));
  if (in.u16() != static_cast<std::uint16_t>(natnet::Message::kFrame)) return std::nullopt;
  in.bytes(2 + 4 + 16);  // size, number, two empty sections
  const int bodies = in.i32();
  in.i32();
  std::optional<Eigen::Vector3d> p;
  for (int i = 0; i < bodies && !in.failed(); ++i) {
    const bool own = in.i32() == body_id_;
    const double x = in.f32(), y = in.f32(), z = in.f32();
    in.bytes(16 + 4);
    const bool tracked = (in.i16() & 1) != 0;
    if (own && tracked) p = Eigen::Vector3d(x, y, z);
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
