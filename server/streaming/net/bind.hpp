#pragma once

#include <string>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>

#include "base/expected.hpp"
#include "middleware/net/listening_ports.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap::net {

/// The reason and the remedy: who uses the port, which key to change.
[[nodiscard]] std::string bind_remedy(const boost::system::error_code& error,
                                      const BindTarget& target, Transport transport);

/// A bound, non-blocking socket.
/// @param shared  several sockets of this machine may receive the same broadcast
/// @return Error `kUnavailable` with the remedy; `kInvalid` when the address is not one
[[nodiscard]] Expected<boost::asio::ip::udp::socket> bind_udp(boost::asio::io_context& io,
                                                              const BindTarget& target,
                                                              bool shared = false);
/// A listening socket.
[[nodiscard]] Expected<boost::asio::ip::tcp::acceptor> listen_tcp(boost::asio::io_context& io,
                                                                  const BindTarget& target);

/// An open connection; other headers can declare this name without Asio.
struct TcpSocket {
  boost::asio::ip::tcp::socket asio;
};

[[nodiscard]] Peer peer_of(const boost::asio::ip::tcp::endpoint& endpoint);
[[nodiscard]] boost::asio::ip::tcp::endpoint endpoint_of(const Peer& peer);

}  // namespace fiducap::net
