#include "streaming/natnet/group_sender.hpp"

#include <algorithm>
#include <utility>

#include "base/log.hpp"

namespace fiducap::natnet {

namespace {

constexpr std::uint32_t kOwnMachine = 0x7f000001;
constexpr int kGroupSendBuffer = 4 << 20;

bool is_own_machine(std::uint32_t address) { return Peer{address, 0}.is_loopback(); }

/// The card that is sent by from the start; 0: none.
std::uint32_t first_card(const NatNetConfig& config) {
  if (!config.multicast_interface.empty())
    return parse_address(config.multicast_interface).value_or(0);
  const std::uint32_t own = parse_address(config.address).value_or(0);
  if (own == 0) return kOwnMachine;
  // Targets in the configuration get frames without asking, groups as well.
  const std::size_t unasked = config.groups().size() - (config.multicast ? 1 : 0);
  return is_own_machine(own) || unasked > 0 ? own : 0;
}

}  // namespace

Expected<GroupSender> GroupSender::open(boost::asio::io_context& io, const NatNetConfig& config) {
  GroupSender sender(io, config);
  const std::uint32_t first = first_card(config);
  if (!sender.has_groups() || first == 0) return sender;
  if (auto added = sender.add(first); !added) return tl::unexpected(added.error());
  return sender;
}

bool GroupSender::asked_at(std::uint32_t own) {
  if (!config_.multicast || !config_.multicast_interface.empty() || own == 0) return false;
  const std::uint32_t card = is_own_machine(own) ? kOwnMachine : own;
  const auto known = [&](const Card& one) { return one.address == card; };
  if (std::any_of(cards_.begin(), cards_.end(), known)) return false;
  const bool failed = std::find(asked_.begin(), asked_.end(), card) != asked_.end();
  if (failed || asked_.size() == kMostCards) return false;
  asked_.push_back(card);
  if (const auto added = add(card); !added) {
    log::warning("natnet", added.error().text());
    return false;
  }
  return true;
}

Expected<void> GroupSender::add(std::uint32_t address) {
  net::UdpOptions options{"natnet"};
  options.fragments = true;
  options.send_buffer_bytes = kGroupSendBuffer;
  // From an address at which commands are heard: some clients ask whoever sends the frames.
  const bool anywhere = parse_address(config_.address).value_or(0) == 0;
  const std::string from = anywhere ? net::address_text({address, 0}) : config_.address;
  auto port = net::UdpServer::open(*io_, {from, 0, "streaming.natnet"}, options);
  if (!port) return tl::unexpected(port.error());
  if (const auto error = port->use_multicast(address, config_.multicast_ttl)) {
    return fail(ErrorCode::kUnavailable,
                "cannot send multicast by " + net::address_text({address, 0}) + " (" +
                    error.message() +
                    "); set it to the address of a card that can (`ip maddr` "
                    "lists them), or streaming.natnet.multicast: false",
                "streaming.natnet.multicast_interface");
  }
  for (const Peer& group : groups_) port->join(group, address);
  cards_.push_back({address, std::move(*port)});
  return {};
}

bool GroupSender::is_silent(const Card& card) const {
  return is_own_machine(card.address) && cards_.size() > 1;
}

void GroupSender::send(std::span<const std::byte> frame) {
  if (frame.empty()) return;
  for (Card& card : cards_) {
    if (is_silent(card)) continue;
    card.port.batch().clear();
    for (const Peer& group : groups_) card.port.add(frame, group);
    card.port.send_batch();
    bool sent = true;
    for (std::size_t i = 0; i < groups_.size(); ++i) sent = card.port.batch().sent(i) && sent;
    ++(sent ? sent_ : dropped_);
  }
}

std::string GroupSender::cards_text() const {
  std::string text;
  for (const Card& card : cards_) {
    if (is_silent(card)) continue;
    text += (text.empty() ? "" : ", ") + net::address_text({card.address, 0});
  }
  return text;
}

}  // namespace fiducap::natnet
