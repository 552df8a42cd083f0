#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "middleware/net/networks.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/natnet/codec.hpp"
#include "streaming/operator_api.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::natnet {

using net::parse_address;
using net::parse_peer;
using net::Peer;

/// Without commas, which separate the fields of commands.
inline constexpr NameRule kNames = conventions_of("natnet").names;

struct NatNetConfig {
  bool enabled{false};               ///< False: this protocol is not served.
  std::string address{"127.0.0.1"};  ///< IPv4. 0.0.0.0: all interfaces.
  std::uint16_t port{1510};          ///< Commands. 0: any free one.
  std::uint16_t data_port{1511};     ///< Of multicast frames; unicast ones leave from there.
  /// Replies at `port` name the group, as the commercial server's default. Off: unicast.
  bool multicast{true};
  bool unicast{true};  ///< Unicast frames for clients that send keep-alives.
  /// With multicast and unicast: replies here name no group, because the vendor's library in
  /// unicast mode ends when it gets one.
  std::uint16_t unicast_port{1520};
  std::string multicast_group{"239.255.42.99"};  ///< Destination of multicast frames.
  /// Address of the interface for multicast; empty: loopback, and interfaces with clients.
  std::string multicast_interface;
  int multicast_ttl{1};          ///< 1: this network only.
  std::string bitstream{"3.1"};  ///< For clients that do not choose one; most read 3.1.
  UpAxis up{conventions_of("natnet").axes.up};
  AxesScope scope{conventions_of("natnet").axes.scope};
  WhenInvalid when_invalid{conventions_of("natnet").when_invalid};
  NameAliases aliases;  ///< Names for the clients, by name of the body.
  /// `ip:port` that get frames without a request, for clients that only listen; also groups.
  std::vector<std::string> targets;
  /// Networks of clients besides the attached ones, e.g. 10.1.0.0/16: NatNet proves no address.
  std::vector<std::string> networks;
  /// Addresses and networks of the only clients besides this machine; empty: those of attached
  /// networks and of `networks`.
  std::vector<std::string> clients;
  int max_clients{64};              ///< Further clients are refused.
  int max_clients_per_address{16};  ///< Of other machines; this one's may take all places.
  double client_timeout_s{15.0};    ///< Of silence; some clients send every 5 s only.
  /// Clients that may rename, disable and record; the protocol has no password.
  RemoteControl remote_control{RemoteControl::kOff};

  [[nodiscard]] OutputAxes axes() const { return {up, scope, 1.0}; }
  [[nodiscard]] Bitstream default_bitstream() const {
    return parse_bitstream(bitstream).value_or(Bitstream{3, 1});
  }
  [[nodiscard]] std::vector<ConfigError> check() const;
  /// Multicast destinations: the group, and those of `targets`.
  [[nodiscard]] std::vector<Peer> groups() const;
  /// The other `targets`.
  [[nodiscard]] std::vector<Peer> listeners() const;
  /// `clients` or `networks`, and the addresses of `listeners`, which may send requests, too.
  [[nodiscard]] std::vector<net::Network> trusted_networks() const;
  [[nodiscard]] ServedProtocol served() const;
};

template <class V>
void describe(V& v, NatNetConfig& c) {
  v.value("enabled", c.enabled);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("data_port", c.data_port);
  v.value("multicast", c.multicast);
  v.value("unicast", c.unicast);
  v.value("unicast_port", c.unicast_port);
  v.value("multicast_group", c.multicast_group);
  v.value("multicast_interface", c.multicast_interface);
  v.value("multicast_ttl", c.multicast_ttl);
  v.value("bitstream", c.bitstream);
  v.word("up", c.up, words::kUpAxis);
  v.word("scope", c.scope, words::kAxesScope);
  v.word("when_invalid", c.when_invalid, words::kWhenInvalid);
  v.value("aliases", c.aliases);
  v.value("targets", c.targets);
  v.value("networks", c.networks);
  v.value("clients", c.clients);
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.value("client_timeout_s", c.client_timeout_s);
  v.word("remote_control", c.remote_control, words::kRemoteControl);
}

using ProtocolConfig = NatNetConfig;

/// Commands and frames by UDP, frames to each client and to a multicast group. The second port of
/// the Streamer names no group.
/// @return Error with the remedy when it cannot bind; `kInvalid` for too many bodies
[[nodiscard]] StartedStreamer serve(const ProtocolContext& context, const NatNetConfig& config);

}  // namespace fiducap::natnet
