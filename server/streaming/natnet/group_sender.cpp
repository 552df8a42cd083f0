#include "streaming/natnet/group_sender.hpp"

#include <algorithm>
#include <utility>

#include "base/log.hpp"

namespace fiducap::natnet {

namespace {

constexpr std::uint32_t kOwnMachine = 0x7f000001;
constexpr int kGroupSendBuffer = 4 << 20;

bool is_own_machine(std::uint32_t address) { return Peer{address, 0}.is_loopback(); }

/// The interface in use from the start; 0: none.
std::uint32_t first_interface(const NatNetConfig& config) {
  if (!config.multicast_interface.empty())
    return parse_address(config.multicast_interface).value_or(0);
  const std::uint32_t own = parse_address(config.address).value_or(0);
  if (own == 0) return kOwnMachine;
  // Configured targets, also groups, get frames without a request.
  const std::size_t unasked = config.groups().size() - (config.multicast ? 1 : 0);
  return is_own_machine(own) || unasked > 0 ? own : 0;
}

}  // namespace

Expected<GroupSender> GroupSender::open(boost::asio::io_context& io, const NatNetConfig& config) {
  GroupSender sender(io, config);
  const std::uint32_t first = first_interface(config);
  if (!sender.has_groups() || first == 0) return sender;
  if (auto added = sender.add(first); !added) return tl::unexpected(added.error());
  return sender;
}

bool GroupSender::add_interface_of(std::uint32_t own) {
  if (!config_.multicast || !config_.multicast_interface.empty() || own == 0) return false;
  const std::uint32_t interface = is_own_machine(own) ? kOwnMachine : own;
  const auto known = [&](const Interface& one) { return one.address == interface; };
  if (std::ranges::any_of(interfaces_, known)) return false;
  const bool failed = std::find(asked_.begin(), asked_.end(), interface) != asked_.end();
  if (failed || asked_.size() == kMostInterfaces) return false;
  asked_.push_back(interface);
  if (const auto added = add(interface); !added) {
    log::warning("natnet", added.error().text());
    return false;
  }
  return true;
}

Expected<void> GroupSender::add(std::uint32_t address) {
  net::UdpOptions options{"natnet"};
  options.fragments = true;
  options.send_buffer_bytes = kGroupSendBuffer;
  // From an address with a command port: some clients send requests to the sender of the frames.
  const bool anywhere = parse_address(config_.address).value_or(0) == 0;
  const std::string from = anywhere ? net::address_text({address, 0}) : config_.address;
  auto port = net::UdpServer::open(*io_, {from, 0, "streaming.natnet"}, options);
  if (!port) return tl::unexpected(port.error());
  if (const auto error = port->use_multicast(address, config_.multicast_ttl))
    return fail(ErrorCode::kUnavailable,
                "cannot send multicast by " + net::address_text({address, 0}) + " (" +
                    error.message() +
                    "); set it to the address of an interface that can (`ip maddr` lists them), or "
                    "streaming.natnet.multicast: false",
                "streaming.natnet.multicast_interface");
  for (const Peer& group : groups_) port->join(group, address);
  interfaces_.push_back({address, std::move(*port)});
  return {};
}

bool GroupSender::is_silent(const Interface& interface) const {
  return is_own_machine(interface.address) && interfaces_.size() > 1;
}

void GroupSender::send(std::span<const std::byte> frame) {
  if (frame.empty()) return;
  for (Interface& interface : interfaces_) {
    if (is_silent(interface)) continue;
    interface.port.batch().clear();
    for (const Peer& group : groups_) interface.port.add(frame, group);
    interface.port.send_batch();
    bool sent = true;
    for (std::size_t i = 0; i < groups_.size(); ++i) sent = interface.port.batch().sent(i) && sent;
    ++(sent ? sent_ : dropped_);
  }
}

std::string GroupSender::interfaces_text() const {
  std::string text;
  for (const Interface& interface : interfaces_) {
    if (is_silent(interface)) continue;
    text += (text.empty() ? "" : ", ") + net::address_text({interface.address, 0});
  }
  return text;
}

}  // namespace fiducap::natnet
