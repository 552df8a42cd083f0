#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "streaming/natnet/natnet_config.hpp"
#include "streaming/net/udp_server.hpp"

namespace fiducap::natnet {

/// Sends frames to the multicast groups of a configuration, by the cards that clients are on.
///
/// `multicast_interface` names the one card. Otherwise this machine is served from the start, and
/// any other card from when somebody asked there: on a network where nobody wants them, no frames
/// are heard.
///
/// The groups are joined here, too, on each card. Then this machine takes in what it sends
/// whichever card a client of its own joined on: most leave that to the system, which says the one
/// to the Internet. For the same reason the loopback is silent as soon as another card speaks: each
/// client of this machine gets a frame once.
class GroupSender final {
 public:
  /// @return Error with the remedy when a card that must be sent by cannot
  [[nodiscard]] static Expected<GroupSender> open(boost::asio::io_context& io,
                                                  const NatNetConfig& config);

  /// Somebody asked at this address of ours, IPv4. @return its card is sent by only from now on
  bool asked_at(std::uint32_t own);
  /// To every group by every card.
  void send(std::span<const std::byte> frame);

  [[nodiscard]] bool has_groups() const { return !groups_.empty(); }
  [[nodiscard]] const std::vector<Peer>& groups() const { return groups_; }
  /// Frames by all cards together; dropped: a socket's buffer was full.
  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  /// Addresses of the cards that are sent by, e.g. `127.0.0.1, 10.0.0.5`; empty: none yet.
  [[nodiscard]] std::string cards_text() const;

 private:
  struct Card {
    std::uint32_t address{};
    net::UdpServer port;
  };
  static constexpr std::size_t kMostCards = 8;

  GroupSender(boost::asio::io_context& io, const NatNetConfig& config)
      : io_(&io), config_(config), groups_(config.groups()) {}
  Expected<void> add(std::uint32_t address);
  [[nodiscard]] bool is_silent(const Card& card) const;

  boost::asio::io_context* io_;
  NatNetConfig config_;
  std::vector<Peer> groups_;
  std::vector<Card> cards_;
  std::vector<std::uint32_t> asked_;  ///< Also of cards that could not be opened.
  std::uint64_t sent_{0};
  std::uint64_t dropped_{0};
};

}  // namespace fiducap::natnet
