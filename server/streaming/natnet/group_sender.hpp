#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "streaming/natnet/natnet.hpp"
#include "streaming/net/udp_server.hpp"

namespace fiducap::natnet {

/// Sends frames to the configured multicast groups, by the interfaces of the clients.
///
/// `multicast_interface` selects the only interface. Otherwise the loopback is used from the start,
/// and any other interface once a client asked there: networks without clients get no frames.
///
/// Also joins the groups on each interface, so that clients of this machine receive them on any of
/// them. The loopback is silent once another interface is used, so that frames come once.
class GroupSender final {
 public:
  /// @return Error with the remedy when a required interface cannot send multicast
  [[nodiscard]] static Expected<GroupSender> open(boost::asio::io_context& io,
                                                  const NatNetConfig& config);

  /// A client asked at this IPv4 address of ours. @return its interface is used from now on
  bool add_interface_of(std::uint32_t own);
  /// To every group by every interface.
  void send(std::span<const std::byte> frame);

  [[nodiscard]] bool has_groups() const { return !groups_.empty(); }
  [[nodiscard]] const std::vector<Peer>& groups() const { return groups_; }
  /// Frames by all interfaces together; dropped: a socket's buffer was full.
  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  /// Addresses of the interfaces in use, e.g. `127.0.0.1, 10.0.0.5`; empty: none yet.
  [[nodiscard]] std::string interfaces_text() const;

 private:
  struct Interface {
    std::uint32_t address{};
    net::UdpServer port;
  };
  static constexpr std::size_t kMostInterfaces = 8;

  GroupSender(boost::asio::io_context& io, const NatNetConfig& config)
      : io_(&io), config_(config), groups_(config.groups()) {}
  Expected<void> add(std::uint32_t address);
  [[nodiscard]] bool is_silent(const Interface& interface) const;

  boost::asio::io_context* io_;
  NatNetConfig config_;
  std::vector<Peer> groups_;
  std::vector<Interface> interfaces_;
  std::vector<std::uint32_t> asked_;  ///< Also of interfaces that could not be opened.
  std::uint64_t sent_{0};
  std::uint64_t dropped_{0};
};

}  // namespace fiducap::natnet
