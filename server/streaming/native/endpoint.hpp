#pragma once

#include <boost/asio/ip/udp.hpp>

#include "streaming/native/peer.hpp"

namespace fiducap::native {

[[nodiscard]] Peer to_peer(const boost::asio::ip::udp::endpoint& from);
/// @param ipv4_socket  the address is for a socket that speaks IPv4 only
[[nodiscard]] boost::asio::ip::udp::endpoint to_endpoint(const Peer& peer, bool ipv4_socket);

}  // namespace fiducap::native
