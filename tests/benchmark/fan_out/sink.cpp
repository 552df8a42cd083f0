#include "fan_out/sink.hpp"

#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "base/bytes.hpp"
#include "support/loopback_socket.hpp"
#include "support/results.hpp"
#include "unit/streaming/natnet/messages.hpp"

namespace fiducap::fan_out {

namespace {

template <typename T>
T little(std::span<const std::byte> bytes, std::size_t at) {
  T value{};
  std::memcpy(&value, bytes.data() + at, sizeof value);  // this machine's own order
  return value;
}
std::uint32_t big(std::span<const std::byte> bytes, std::size_t at) {
  return ntohl(little<std::uint32_t>(bytes, at));
}

int with_large_buffer(int fd) {
  constexpr int kReceiveBuffer = 8 << 20;
  ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &kReceiveBuffer, sizeof kReceiveBuffer);
  return fd;
}
int open_stream(std::uint16_t port) { return with_large_buffer(connected_socket(port)); }

/// @throws std::runtime_error when the bytes do not go at once
void send_all(int fd, std::span<const std::byte> bytes) {
  if (::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(bytes.size()))
    throw std::runtime_error("the server does not read");
}

/// Counts pose reports of `body1`; names and types are learned from the descriptions.
class VrpnSink final : public Sink {
 public:
  VrpnSink(const Load& load, const Shared& shared)
      : Sink(open_stream(shared.ports[Shared::kVrpn]), load, shared, "vrpn", "tcp") {
    std::string cookie = "vrpn: ver. 07.35  0";
    cookie.resize(kCookie, '\0');
    send_all(fd(), bytes_of(cookie));
  }

 private:
  static constexpr std::size_t kCookie = 24;
  static constexpr std::size_t kHeader = 24;

  std::size_t parse(std::span<const std::byte> bytes, std::int64_t now_ns) override {
    std::size_t used = 0;
    if (!greeted_) {
      if (bytes.size() < kCookie) return 0;
      greeted_ = true;
      used = kCookie;
    }
    while (bytes.size() - used >= kHeader) {
      const auto message = bytes.subspan(used);
      const std::size_t length = big(message, 0);
      const std::size_t padded = kHeader + (length - kHeader + 7) / 8 * 8;
      if (message.size() < padded) break;
      take(message.first(length), now_ns);
      used += padded;
    }
    return used;
  }

  void take(std::span<const std::byte> message, std::int64_t now_ns) {
    const auto sender = static_cast<std::int32_t>(big(message, 12));
    const auto type = static_cast<std::int32_t>(big(message, 16));
    if (type == -1 || type == -2) {
      const std::string name(reinterpret_cast<const char*>(message.data()) + kHeader + 4);
      if (type == -1 && name == "body1") body_ = sender;
      if (type == -2 && name == "vrpn_Tracker Pos_Quat") pose_ = sender;
      return;
    }
    if (type != pose_ || sender != body_) return;
    const std::int64_t utc_ns =
        std::int64_t{big(message, 4)} * 1'000'000'000 + std::int64_t{big(message, 8)} * 1000;
    saw_instant(utc_ns - shared().utc_offset_ns, now_ns);
  }

  bool greeted_{false};
  std::int32_t body_{-100};
  std::int32_t pose_{-100};
};

class NatNetSink final : public Sink {
 public:
  NatNetSink(const Load& load, const Shared& shared)
      : Sink(with_large_buffer(bound_socket(SOCK_DGRAM)), load, shared, "natnet", "4.1 unicast"),
        port_(shared.ports[Shared::kNatNet]) {
    send_datagram(fd(), natnet::connect({4, 1}, {4, 1}), port_);
    keep_alive();
  }
  void keep_alive() override {
    send_datagram(fd(), natnet::message(natnet::Message::kKeepAlive), port_);
  }

 private:
  std::size_t parse(std::span<const std::byte> bytes, std::int64_t now_ns) override {
    if (bytes.size() >= 8 &&
        little<std::uint16_t>(bytes, 0) == static_cast<std::uint16_t>(natnet::Message::kFrame))
      saw_number(little<std::uint32_t>(bytes, 4), now_ns);
    return bytes.size();
  }

  std::uint16_t port_;
};

/// Server push, segments with occlusion and latency, as the SDK requests.
class ViconSink final : public Sink {
 public:
  ViconSink(const Load& load, const Shared& shared)
      : Sink(open_stream(shared.ports[Shared::kVicon]), load, shared, "vicon", "server push") {
    std::vector<std::byte> types;
    LittleEndianWriter out(types);
    out.u32(static_cast<std::uint32_t>(kRequested.size()));
    for (const std::uint32_t type : kRequested) out.u32(type);
    request(100001, types);
    request(100002, {std::byte{1}});
  }

 private:
  static constexpr std::uint32_t kTag = 0x1A2B0001;
  static constexpr std::uint32_t kFrameNumber = 5;
  static constexpr std::array<std::uint32_t, 14> kRequested{1,  2,  5,  8,  9,  23,    26,
                                                            28, 36, 37, 39, 40, 28001, 100004};

  void request(std::uint32_t type, const std::vector<std::byte>& payload) const {
    std::vector<std::byte> packet;
    const auto size = static_cast<std::uint32_t>(payload.size());
    LittleEndianWriter(packet).u32(kTag).u32(8 + size).u32(type).u32(size);
    packet.insert(packet.end(), payload.begin(), payload.end());
    send_all(fd(), packet);
  }

  std::size_t parse(std::span<const std::byte> bytes, std::int64_t now_ns) override {
    std::size_t used = 0;
    while (bytes.size() - used >= 8) {
      const std::size_t size = 8 + std::size_t{little<std::uint32_t>(bytes, used + 4)};
      if (bytes.size() - used < size) break;
      take(bytes.subspan(used + 8, size - 8), now_ns);
      used += size;
    }
    return used;
  }

  /// Objects one after the other: type, size, content.
  void take(std::span<const std::byte> objects, std::int64_t now_ns) {
    while (objects.size() >= 8) {
      const auto type = little<std::uint32_t>(objects, 0);
      const std::size_t size = little<std::uint32_t>(objects, 4);
      if (objects.size() < 8 + size) return;
      if (type == kFrameNumber && size >= 4) saw_count(little<std::uint32_t>(objects, 8), now_ns);
      objects = objects.subspan(8 + size);
    }
  }
};

class QualisysSink final : public Sink {
 public:
  QualisysSink(const Load& load, const Shared& shared)
      : Sink(open_stream(static_cast<std::uint16_t>(shared.ports[Shared::kQualisys] + 1)), load,
             shared, "qualisys", "6D tcp") {
    request("Version 1.23");
    request("StreamFrames AllFrames 6D");
  }

 private:
  void request(const std::string& command) const {
    std::vector<std::byte> packet;
    packet.reserve(64);
    LittleEndianWriter(packet)
        .u32(static_cast<std::uint32_t>(8 + command.size() + 1))
        .u32(1)
        .text(command)
        .u8(0);
    send_all(fd(), packet);
  }

  std::size_t parse(std::span<const std::byte> bytes, std::int64_t now_ns) override {
    constexpr std::uint32_t kData = 3;
    std::size_t used = 0;
    while (bytes.size() - used >= 8) {
      const std::size_t size = little<std::uint32_t>(bytes, used);
      if (bytes.size() - used < size) break;
      if (little<std::uint32_t>(bytes, used + 4) == kData)
        saw_count(little<std::uint32_t>(bytes, used + 16), now_ns);
      used += size;
    }
    return used;
  }
};

}  // namespace

std::int64_t steady_ns() {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void Tally::take(std::uint64_t number, double latency) {
  if (frames > 0 && number <= last_) return;
  if (frames > 0) missing += number - last_ - 1;
  last_ = number;
  ++frames;
  if (frames > kWarmUp) latency_us.push_back(static_cast<float>(latency));
}

Sink::Sink(int fd, const Load& load, const Shared& shared, std::string protocol, std::string mode)
    : fd_(fd), load_(load), shared_(shared) {
  tally.protocol = std::move(protocol);
  tally.mode = std::move(mode);
  tally.latency_us.reserve(static_cast<std::size_t>(load.seconds * load.rate_hz));
}

Sink::~Sink() { ::close(fd_); }

void Sink::pump(std::int64_t now_ns) {
  std::array<std::byte, 65536> chunk{};
  for (;;) {
    const ssize_t n = ::recv(fd_, chunk.data(), chunk.size(), 0);
    if (n <= 0) return;
    in_.insert(in_.end(), chunk.data(), chunk.data() + n);
    const std::size_t used = parse(in_, now_ns);
    in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(used));
  }
}

void Sink::saw_number(std::uint64_t number, std::int64_t now_ns) {
  const double period_ns = 1e9 / load_.rate_hz;
  const double at_ns =
      static_cast<double>(shared_.first_at_ns) + static_cast<double>(number - 1) * period_ns;
  tally.take(number, 1e-3 * (static_cast<double>(now_ns) - at_ns));
}

void Sink::saw_instant(std::int64_t at_ns, std::int64_t now_ns) {
  const double period_ns = 1e9 / load_.rate_hz;
  saw_number(1 + static_cast<std::uint64_t>(
                     std::llround(static_cast<double>(at_ns - shared_.first_at_ns) / period_ns)),
             now_ns);
}

void Sink::saw_count(std::uint64_t count, std::int64_t now_ns) {
  // The first frame is less than a period old: counting starts there.
  if (!count_start_)
    count_start_ =
        static_cast<std::int64_t>(count) - static_cast<std::int64_t>(shared_.frames.load());
  saw_number(static_cast<std::uint64_t>(static_cast<std::int64_t>(count) - *count_start_), now_ns);
}

std::vector<std::unique_ptr<Sink>> make_sinks(const Load& load, const Shared& shared) {
  std::vector<std::unique_ptr<Sink>> all;
  all.push_back(std::make_unique<VrpnSink>(load, shared));
  all.push_back(std::make_unique<NatNetSink>(load, shared));
  all.push_back(std::make_unique<ViconSink>(load, shared));
  all.push_back(std::make_unique<QualisysSink>(load, shared));
  return all;
}

}  // namespace fiducap::fan_out
