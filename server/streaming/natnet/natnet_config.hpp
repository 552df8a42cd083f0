#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "middleware/net/networks.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/natnet/bitstream.hpp"
#include "streaming/operator_desk.hpp"

namespace fiducap::natnet {

using net::parse_address;
using net::parse_peer;
using net::Peer;

struct NatNetConfig {
  bool enabled{false};
  std::string address{"127.0.0.1"};  ///< IPv4. 0.0.0.0: all interfaces.
  std::uint16_t port{1510};          ///< Commands. 0: any free one.
  std::uint16_t data_port{1511};     ///< Where multicast frames go; clients are told.
  /// As the commercial server's default: clients at `port` are told to join the group. Off: they
  /// are told that each gets frames of its own.
  bool multicast{true};
  /// Whoever sends keep-alives at `port` gets frames of its own.
  bool unicast{true};
  /// With both: the vendor's library in unicast mode goes away when it hears of a group; here it is
  /// told of none.
  std::uint16_t unicast_port{1520};
  std::string multicast_group{"239.255.42.99"};
  /// Address of the card that multicast frames leave by; empty: this machine, and each card where
  /// somebody asked.
  std::string multicast_interface;
  int multicast_ttl{1};
  std::string bitstream{"3.1"};  ///< For clients that do not say; 3.1 is what most of them read.
  UpAxis up{conventions_of("natnet").axes.up};
  AxesScope scope{conventions_of("natnet").axes.scope};
  WhenInvalid when_invalid{conventions_of("natnet").when_invalid};
  NameAliases aliases;
  std::vector<std::string> targets;  ///< `ip:port` that get frames without asking, for clients that
                                     ///< only listen; a multicast group as well.
  /// Who may be a client beside the networks that this machine is attached to, e.g. 10.1.0.0/16:
  /// NatNet proves no address, and frames go to whoever asks.
  std::vector<std::string> networks;
  int max_clients{64};
  int max_clients_per_address{16};  ///< Of others; this machine's own may take all places.
  double client_timeout_s{15.0};    ///< Of silence; some clients speak every 5 s only.
  /// The protocol knows no password: whoever this lets in may rename, disable and record.
  RemoteControl remote_control{RemoteControl::kOff};

  [[nodiscard]] OutputAxes axes() const { return {up, scope, 1.0}; }
  [[nodiscard]] Bitstream default_bitstream() const {
    return parse_bitstream(bitstream).value_or(Bitstream{3, 1});
  }
  /// Commas separate the fields of commands: a body with one in its name could not be addressed.
  [[nodiscard]] NameRule name_rule() const;
  [[nodiscard]] std::vector<ConfigError> check() const;
  /// Where multicast frames go: the group, and those of `targets`.
  [[nodiscard]] std::vector<Peer> groups() const;
  /// The other `targets`.
  [[nodiscard]] std::vector<Peer> listeners() const;
  /// `networks` and the addresses of `listeners`, which may ask, too.
  [[nodiscard]] std::vector<net::Network> trusted_networks() const;
  /// Where it listens and what its clients receive.
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
  v.value("max_clients", c.max_clients);
  v.value("max_clients_per_address", c.max_clients_per_address);
  v.value("client_timeout_s", c.client_timeout_s);
  v.word("remote_control", c.remote_control, words::kRemoteControl);
}

using ProtocolConfig = NatNetConfig;

}  // namespace fiducap::natnet
