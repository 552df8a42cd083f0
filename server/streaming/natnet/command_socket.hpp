#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>

#include "base/expected.hpp"
#include "streaming/natnet/conversation.hpp"
#include "streaming/net/bind.hpp"

namespace fiducap::natnet {

/// A UDP socket for requests and answers: an answer leaves from the address that the request was
/// sent to, also when the socket listens on all of them; for a broadcast, from that of the
/// interface it came in on.
class CommandSocket final {
 public:
  struct Received {
    std::span<const std::byte> datagram;  ///< Lives until the next `receive`.
    Peer from;
    std::uint32_t to{};  ///< Our address.
  };

  [[nodiscard]] static Expected<CommandSocket> open(boost::asio::io_context& io,
                                                    const net::BindTarget& target, Channel channel);

  /// @return nullopt when nothing waits
  [[nodiscard]] std::optional<Received> receive(std::span<std::byte> buffer);
  /// One that the socket does not take is lost like any other; the client asks again.
  /// @param from  as in Received
  void send(std::span<const std::byte> datagram, const Peer& to, std::uint32_t from);

  [[nodiscard]] boost::asio::ip::udp::socket& socket() { return socket_; }
  [[nodiscard]] std::uint16_t port() const { return port_; }  ///< Also when it is closed.
  [[nodiscard]] Channel channel() const { return channel_; }

 private:
  CommandSocket(boost::asio::ip::udp::socket socket, Channel channel)
      : socket_(std::move(socket)), port_(socket_.local_endpoint().port()), channel_(channel) {}

  boost::asio::ip::udp::socket socket_;
  std::uint16_t port_;
  Channel channel_;
};

}  // namespace fiducap::natnet
