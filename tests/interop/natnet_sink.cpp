// A strict unicast NatNet 4.1 client for `natnet_stage`: checks every byte it understands and
// measures.
//
//   natnet_sink [server=127.0.0.1] [port=1510] [bodies=1000] [seconds=10] [up=y]
//
// A frame is whole when its sections add up to the datagram and every body is where the stage put
// it.
#include <poll.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>
#include <string_view>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>

#include "base/bytes.hpp"
#include "key_values.hpp"
#include "streaming/natnet/codec.hpp"

namespace fiducap::natnet {
namespace {

namespace asio = boost::asio;
using asio::ip::udp;

constexpr int kReceiveBuffer = 8 << 20;
constexpr double kFloat = 1e-5;  // f32 on the wire, metres of some tens

std::int64_t now_ns() { return read_ns(CLOCK_MONOTONIC); }

struct Tally {
  std::uint64_t frames{};
  std::uint64_t broken{};
  std::uint64_t lost{};
  std::uint64_t bodies{};
  std::int32_t last{-1};
  std::vector<std::int64_t> latency_ns;
};

/// @return false when anything in the frame is not as the stage made it
bool check(std::span<const std::byte> datagram, int bodies, Tally& tally) {
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
    places = places && id == k && (here || !valid) && valid == (k != 3 || number / 100 % 2 == 0);
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

std::vector<std::byte> connect_request() {
  std::vector<std::byte> bytes;
  bytes.reserve(kHeaderSize + 269);
  LittleEndianWriter(bytes)
      .u16(0)
      .u16(269)
      .text("natnet_sink")
      .zeros(245 + 4)
      .u8(4)
      .u8(1)
      .zeros(2)
      .u8(0)
      .u8(4)
      .u8(1)
      .zeros(2);
  return bytes;
}

std::vector<std::byte> keep_alive() {
  std::vector<std::byte> bytes;
  bytes.reserve(kHeaderSize);
  LittleEndianWriter(bytes).u16(static_cast<std::uint16_t>(Message::kKeepAlive)).u16(0);
  return bytes;
}

int run(const KeyValues& given) {
  const int bodies = static_cast<int>(given.number("bodies", 1000));
  const auto duration_ns = static_cast<std::int64_t>(given.number("seconds", 10)) * 1'000'000'000;
  asio::io_context io;
  udp::socket socket(io, udp::endpoint(udp::v4(), 0));
  socket.set_option(asio::socket_base::receive_buffer_size(kReceiveBuffer));
  const udp::endpoint server(asio::ip::make_address(given.text("server", "127.0.0.1")),
                             static_cast<std::uint16_t>(given.number("port", 1510)));
  socket.send_to(asio::buffer(connect_request()), server);
  socket.send_to(asio::buffer(keep_alive()), server);
  Tally tally;
  std::vector<std::byte> buffer(65536);
  const std::int64_t start = now_ns();
  std::int64_t asked = start;
  while (now_ns() - start < duration_ns) {
    if (now_ns() - asked > 1'000'000'000) {
      socket.send_to(asio::buffer(keep_alive()), server);
      asked = now_ns();
    }
    pollfd wait{socket.native_handle(), POLLIN, 0};
    if (::poll(&wait, 1, 100) <= 0) continue;
    udp::endpoint from;
    const auto size = socket.receive_from(asio::buffer(buffer), from);
    if (from == server) continue;  // an answer
    ++tally.frames;
    if (!check(std::span<const std::byte>(buffer).first(size), bodies, tally)) ++tally.broken;
  }
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

}  // namespace
}  // namespace fiducap::natnet

int main(int argc, char** argv) {
  fiducap::KeyValues given;
  return given.parse(argc, argv) ? fiducap::natnet::run(given) : 2;
}
