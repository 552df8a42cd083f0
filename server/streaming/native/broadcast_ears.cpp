#include "streaming/native/broadcast_ears.hpp"

#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <array>

#include "base/log.hpp"
#include "streaming/native/wire.hpp"

namespace fiducap::native {

namespace {

namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

// Heard before other work of the I/O thread gets its turn.
constexpr int kQueriesPerTurn = 32;

/// Of the networks in which this machine has `own`.
std::vector<asio::ip::address_v4> broadcasts_of(const asio::ip::address_v4& own) {
  std::vector<asio::ip::address_v4> found;
  ifaddrs* interfaces = nullptr;
  if (::getifaddrs(&interfaces) != 0) return found;
  const auto address_of = [](const sockaddr* a) {
    return asio::ip::address_v4(ntohl(reinterpret_cast<const sockaddr_in*>(a)->sin_addr.s_addr));
  };
  for (const ifaddrs* it = interfaces; it != nullptr; it = it->ifa_next) {
    if (it->ifa_addr == nullptr || it->ifa_addr->sa_family != AF_INET ||
        (it->ifa_flags & IFF_BROADCAST) == 0)
      continue;
    if (address_of(it->ifa_addr) == own && it->ifa_broadaddr != nullptr)
      found.push_back(address_of(it->ifa_broadaddr));
  }
  ::freeifaddrs(interfaces);
  return found;
}

}  // namespace

/// Shared with its one pending wait, which may outlive the server in the I/O queue.
struct BroadcastEars::Ear : std::enable_shared_from_this<Ear> {
  Ear(asio::io_context& io, Heard handler) : socket(io), heard(std::move(handler)) {}

  void listen() {
    socket.async_wait(udp::socket::wait_read, [self = shared_from_this()](const error_code& error) {
      if (error || !self->socket.is_open()) return;
      self->read();
      if (self->socket.is_open()) self->listen();
    });
  }
  void read() {
    std::array<std::byte, kMaxDatagram + 1> bytes;
    udp::endpoint from;
    for (int i = 0; i < kQueriesPerTurn && socket.is_open(); ++i) {
      error_code error;
      const auto size = socket.receive_from(asio::buffer(bytes), from, 0, error);
      if (error) return;
      heard(std::span<const std::byte>(bytes).first(size), from);
    }
  }

  udp::socket socket;
  Heard heard;
};

BroadcastEars::BroadcastEars(asio::io_context& io, const std::string& address, std::uint16_t port,
                             Heard heard) {
  error_code error;
  const auto own = asio::ip::make_address_v4(address, error);
  if (error || own.is_loopback() || own.is_unspecified()) return;
  for (const auto& broadcast : broadcasts_of(own)) {
    auto ear = std::make_shared<Ear>(io, heard);
    ear->socket.open(udp::v4(), error);
    // Several servers of one machine may hear the same broadcast.
    if (!error) ear->socket.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) ear->socket.bind({broadcast, port}, error);
    if (!error) ear->socket.non_blocking(true, error);
    if (error) {
      log::warning("native", "will not be discovered by broadcast to " + broadcast.to_string() +
                                 ": " + error.message());
      continue;
    }
    ear->listen();
    ears_.push_back(std::move(ear));
  }
}

void BroadcastEars::stop() {
  for (const auto& ear : ears_) {
    error_code ignored;
    ear->socket.close(ignored);
  }
  ears_.clear();
}

}  // namespace fiducap::native
