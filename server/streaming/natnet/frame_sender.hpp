#pragma once

#include <netinet/in.h>

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>

#include "base/expected.hpp"
#include "streaming/natnet/natnet_config.hpp"
#include "streaming/net/datagram_batch.hpp"

namespace fiducap::natnet {

/// The socket that frames leave by: one system call for all clients, frames above the MTU in IP fragments.
///
/// Never the command socket: the vendor's library ignores unicast frames that come from the command port.
class FrameSender final {
 public:
  [[nodiscard]] static Expected<FrameSender> open(boost::asio::io_context& io, const NatNetConfig& config);

  void clear();
  /// The bytes live until `send`. @pre not more than `most` since `clear`
  void add(std::span<const std::byte> frame, const Peer& to);
  void send() { batch_.send(socket_.native_handle()); }
  /// After `send`: did the socket take the i-th one?
  [[nodiscard]] bool sent(std::size_t i) const { return batch_.sent(i); }
  [[nodiscard]] std::size_t size() const { return addresses_.size(); }
  /// A peer whose machine said that nobody listens at that port. @return nullopt: no more of them
  [[nodiscard]] std::optional<Peer> next_refused();

 private:
  FrameSender(boost::asio::ip::udp::socket socket, std::size_t most);

  boost::asio::ip::udp::socket socket_;
  net::DatagramBatch batch_;
  std::vector<sockaddr_in> addresses_;  ///< Reserved once: the batch points at them.
};

}  // namespace fiducap::natnet
