#include "streaming/net/bind.hpp"

#include <boost/asio/ip/address.hpp>

namespace fiducap::net {

namespace {

namespace asio = boost::asio;
using boost::system::error_code;

constexpr std::uint16_t kFirstFreePort = 1024;

std::string where(const BindTarget& target, std::string_view transport) {
  return target.address + ":" + std::to_string(target.port) + " " + std::string(transport);
}

Expected<asio::ip::address> address_of(const BindTarget& target) {
  error_code error;
  const auto address = asio::ip::make_address(target.address, error);
  if (error)
    return fail(
        ErrorCode::kInvalid,
        "expected an IP address, e.g. 127.0.0.1 or 0.0.0.0 for all, got \"" + target.address + "\"",
        std::string(target.key) + ".address");
  return address;
}

}  // namespace

std::string bind_remedy(const error_code& error, const BindTarget& target, Transport transport) {
  namespace errc = boost::system::errc;
  const std::string number = std::to_string(target.port);
  const std::string section(target.key);
  const std::string key = section + "." + std::string(target.port_key);
  if (error == errc::address_in_use)
    return "the port is used by " + owner_of(target.port, transport) +
           ": end that (`sudo ss -tulpn | grep " + number + "` shows it), or set " + key +
           " to a free one";
  if (error == errc::permission_denied && target.port < kFirstFreePort)
    return "ports below 1024 need a permission: `sudo setcap cap_net_bind_service=+ep` on "
           "fiducapd, or `sudo sysctl net.ipv4.ip_unprivileged_port_start=" +
           number + "`, or set " + key + " to 1024 or above";
  if (error == errc::address_not_available)
    return "this machine has no interface with the address " + target.address + "; set " + section +
           ".address to one of its addresses (`ip addr` lists them) or to 0.0.0.0 for all";
  return "cannot use port " + number + ": " + error.message();
}

Expected<asio::ip::udp::socket> bind_udp(asio::io_context& io, const BindTarget& target,
                                         bool shared) {
  const auto address = address_of(target);
  if (!address) return tl::unexpected(address.error());
  const asio::ip::udp::endpoint endpoint(*address, target.port);
  asio::ip::udp::socket socket(io);
  error_code error;
  socket.open(endpoint.protocol(), error);
  if (!error && shared) socket.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) socket.bind(endpoint, error);
  if (!error) socket.non_blocking(true, error);
  if (error)
    return fail(ErrorCode::kUnavailable, bind_remedy(error, target, Transport::kUdp),
                where(target, "udp"));
  return socket;
}

Expected<asio::ip::tcp::acceptor> listen_tcp(asio::io_context& io, const BindTarget& target) {
  const auto address = address_of(target);
  if (!address) return tl::unexpected(address.error());
  const asio::ip::tcp::endpoint endpoint(*address, target.port);
  asio::ip::tcp::acceptor acceptor(io);
  error_code error;
  acceptor.open(endpoint.protocol(), error);
  // A restart does not wait for connections that were just closed.
  if (!error) acceptor.set_option(asio::ip::tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error)
    return fail(ErrorCode::kUnavailable, bind_remedy(error, target, Transport::kTcp),
                where(target, "tcp"));
  return acceptor;
}

Peer peer_of(const asio::ip::tcp::endpoint& endpoint) {
  return SocketAddress(endpoint.data(), static_cast<socklen_t>(endpoint.size())).peer();
}

asio::ip::tcp::endpoint endpoint_of(const Peer& peer) {
  if (peer.is_ipv4()) return {asio::ip::address_v4(peer.ipv4()), peer.port};
  return {asio::ip::address_v6(peer.address, peer.scope), peer.port};
}

}  // namespace fiducap::net
