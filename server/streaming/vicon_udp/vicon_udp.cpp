#include "streaming/vicon_udp/vicon_udp.hpp"

#include <algorithm>

#include "streaming/vicon_udp/codec.hpp"

namespace fiducap::vicon_udp {

namespace {

constexpr std::size_t kMostTargets = 64;
constexpr std::uint32_t kFirstGroup = 0xe0000000;  // 224.0.0.0
constexpr std::uint32_t kLastGroup = 0xefffffff;

}  // namespace

std::optional<net::Peer> receiver_in(const std::string& text) {
  const auto peer = net::parse_peer(text);
  const bool is_group = peer && peer->ipv4() >= kFirstGroup && peer->ipv4() <= kLastGroup;
  return peer && peer->port != 0 && !is_group ? peer : std::nullopt;
}

std::vector<ConfigError> ViconUdpConfig::check() const {
  Checker rules{"streaming.vicon_udp."};
  rules.require(targets.size() <= kMostTargets, "targets", targets.size(), "must be at most 64")
      .require(!enabled || !targets.empty(), "targets", "[]",
               "must name a receiver, e.g. 127.0.0.1:51001")
      .require(std::ranges::count(kBlockSizes, block_bytes) == 1, "block_bytes", block_bytes,
               "must be 256, 512 or 1024")
      .require(when_invalid != WhenInvalid::kFlag, "when_invalid", "flag",
               "must be stop or hold: the protocol has no flag for invalid poses");
  for (const auto& target : targets)
    rules.require(receiver_in(target).has_value(), "targets", target,
                  "must be ip:port of a receiver or of a broadcast, e.g. 10.0.0.7:51001");
  return rules.errors;
}

}  // namespace fiducap::vicon_udp
