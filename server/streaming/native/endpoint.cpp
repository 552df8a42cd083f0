#include "streaming/native/endpoint.hpp"

#include <algorithm>

namespace fiducap::native {

namespace ip = boost::asio::ip;

Peer to_peer(const ip::udp::endpoint& from) {
  Peer peer;
  peer.port = from.port();
  const auto address = from.address();
  const auto as_v6 =
      address.is_v6() ? address.to_v6() : ip::make_address_v6(ip::v4_mapped, address.to_v4());
  const auto bytes = as_v6.to_bytes();
  std::copy(bytes.begin(), bytes.end(), peer.address.begin());
  peer.scope = address.is_v6() ? static_cast<std::uint32_t>(as_v6.scope_id()) : 0;
  return peer;
}

ip::udp::endpoint to_endpoint(const Peer& peer, bool ipv4_socket) {
  ip::address_v6::bytes_type bytes;
  std::copy(peer.address.begin(), peer.address.end(), bytes.begin());
  const ip::address_v6 as_v6(bytes, peer.scope);
  if (ipv4_socket) return {ip::make_address_v4(ip::v4_mapped, as_v6), peer.port};
  return {as_v6, peer.port};
}

}  // namespace fiducap::native
