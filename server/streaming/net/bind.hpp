#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>

#include "base/expected.hpp"

namespace fiducap::net {

/// Where a protocol listens, and how its user would change that.
struct BindTarget {
  std::string address;   ///< IP address of one interface, or 0.0.0.0.
  std::uint16_t port{};  ///< 0: any free one.
  std::string_view key;  ///< Section of the configuration, e.g. `streaming.natnet`.
  std::string_view port_key{"port"};
};

/// What went wrong and what to do next: who has the port, which key to change.
[[nodiscard]] std::string bind_remedy(const boost::system::error_code& error,
                                      const BindTarget& target);

/// A bound, non-blocking socket. @return Error `kUnavailable` with the remedy, `kInvalid` for an
/// address that is none.
[[nodiscard]] Expected<boost::asio::ip::udp::socket> bind_udp(boost::asio::io_context& io,
                                                              const BindTarget& target);
/// A listening socket.
[[nodiscard]] Expected<boost::asio::ip::tcp::acceptor> listen_tcp(boost::asio::io_context& io,
                                                                  const BindTarget& target);

/// `10.0.0.7:41522 udp`
[[nodiscard]] std::string peer_text(const boost::asio::ip::tcp::endpoint& peer);
[[nodiscard]] std::string peer_text(const boost::asio::ip::udp::endpoint& peer);

}  // namespace fiducap::net
