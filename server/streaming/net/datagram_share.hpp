#pragma once

#include <netinet/in.h>

#include <boost/asio/ip/tcp.hpp>
#include <cstddef>
#include <cstdint>

#include "streaming/net/datagram_batch.hpp"

namespace fiducap::net {

/// What a client of a TCP server gets by UDP: where to, which messages of the batch under way are
/// its, what became of them.
class DatagramShare final {
 public:
  /// The TCP peer's address, whatever address the client named, and its port: nobody can aim frames
  /// at a third party.
  /// @return holds until the next call
  const sockaddr_in& aim(const boost::asio::ip::tcp::endpoint& peer, std::uint16_t port) {
    target_.sin_family = AF_INET;
    target_.sin_port = htons(port);
    target_.sin_addr.s_addr = htonl(peer.address().to_v4().to_uint());
    return target_;
  }
  /// Nothing in this batch.
  void clear() { begin_ = end_ = 0; }
  void open(const DatagramBatch& batch) { begin_ = batch.size(); }
  void close(const DatagramBatch& batch) { end_ = batch.size(); }
  /// After the batch was sent: a frame counts when the socket took all of its messages.
  void settle(const DatagramBatch& batch) {
    if (begin_ == end_) return;
    bool whole = true;
    for (std::size_t i = begin_; i < end_; ++i) whole = whole && batch.sent(i);
    ++(whole ? sent_ : dropped_);
    clear();
  }
  /// A frame too long for any datagram.
  void drop() { ++dropped_; }

  [[nodiscard]] std::uint64_t frames_sent() const { return sent_; }
  [[nodiscard]] std::uint64_t frames_dropped() const { return dropped_; }

 private:
  sockaddr_in target_{};
  std::size_t begin_{0};
  std::size_t end_{0};
  std::uint64_t sent_{0};
  std::uint64_t dropped_{0};
};

}  // namespace fiducap::net
