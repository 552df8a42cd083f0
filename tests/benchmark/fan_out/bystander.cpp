#include <array>

#include "fan_out/sink.hpp"
#include "src/codec.hpp"
#include "support/loopback_socket.hpp"
#include "support/results.hpp"

namespace fiducap::fan_out {

namespace {

/// The native protocol by hand: a library would read on a thread of its own.
class NativeBystander final : public Sink {
 public:
  NativeBystander(const Load& load, const Shared& shared)
      : Sink(open_datagrams(), load, shared, "native", "udp"),
        server_(shared.ports[Shared::kNative]) {
    request_.nonce = port_of(fd());
    request_.client_name = "bystander";
    keep_alive();
  }
  void keep_alive() override {
    const auto bytes = sdk::encode(request_);
    send_datagram(fd(), std::as_bytes(std::span(bytes)), server_);
  }

 private:
  std::size_t parse(std::span<const std::byte> bytes, std::int64_t) override {
    const auto kind =
        decoder_.decode(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    if (kind == sdk::MessageKind::kChallenge) {
      request_.token = decoder_.challenge().token;
      keep_alive();
    }
    if (kind == sdk::MessageKind::kLease) request_.token = decoder_.lease().token;
    return bytes.size();
  }

  std::uint16_t server_;
  sdk::SubscribeRequest request_;
  sdk::Decoder decoder_;
};

/// Connection by TCP, reports by UDP.
class VrpnUdpBystander final : public Sink {
 public:
  VrpnUdpBystander(const Load& load, const Shared& shared)
      : Sink(open_datagrams(), load, shared, "vrpn", "udp"),
        tcp_(open_stream(shared.ports[Shared::kVrpn])) {
    constexpr std::size_t kCookie = 24;
    constexpr std::uint32_t kUdpDescription = static_cast<std::uint32_t>(-3);
    const std::string address = "127.0.0.1";
    std::string hello = "vrpn: ver. 07.35  0";
    hello.resize(kCookie, '\0');
    const auto padded = static_cast<std::uint32_t>((address.size() + 1 + 7) / 8 * 8);
    for (const std::uint32_t word : {std::uint32_t(24 + address.size() + 1), 0U, 0U,
                                     std::uint32_t{port_of(fd())}, kUdpDescription, 0U}) {
      const std::uint32_t big = htonl(word);
      hello.append(reinterpret_cast<const char*>(&big), sizeof big);
    }
    hello += address;
    hello.append(padded - address.size(), '\0');
    send_all(tcp_, bytes_of(hello));
  }
  ~VrpnUdpBystander() override { ::close(tcp_); }
  void keep_alive() override {
    std::array<char, 4096> unread{};
    while (reading() && ::recv(tcp_, unread.data(), unread.size(), 0) > 0) {
    }
  }

 private:
  std::size_t parse(std::span<const std::byte> bytes, std::int64_t) override {
    return bytes.size();
  }

  int tcp_;
};

/// A page in a browser: requests the live socket, nothing more.
class PageBystander final : public Sink {
 public:
  PageBystander(const Load& load, const Shared& shared)
      : Sink(open_stream(shared.ports[Shared::kWeb]), load, shared, "web", "live page") {
    const std::string host = "127.0.0.1:" + std::to_string(shared.ports[Shared::kWeb]);
    send_all(
        fd(),
        bytes_of("GET /api/v1/live HTTP/1.1\r\nHost: " + host + "\r\nOrigin: http://" + host +
                 "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                 "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"));
  }

 private:
  std::size_t parse(std::span<const std::byte> bytes, std::int64_t) override {
    return bytes.size();
  }
};

}  // namespace

std::vector<std::unique_ptr<Sink>> make_bystanders(const Load& load, const Shared& shared) {
  auto all = make_sinks(load, shared);
  all.push_back(std::make_unique<NativeBystander>(load, shared));
  all.push_back(std::make_unique<VrpnUdpBystander>(load, shared));
  all.push_back(std::make_unique<PageBystander>(load, shared));
  return all;
}

}  // namespace fiducap::fan_out
