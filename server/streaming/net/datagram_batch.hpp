#pragma once

#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "middleware/net/peer.hpp"

namespace fiducap::net {

/// Many datagrams to many addresses by as few system calls as the kernel allows, never waiting.
///
/// `clear`, `add` for every datagram, `send`. Keeps its memory, so that nothing is allocated per
/// frame. Bytes are only pointed at: they must live until `send`.
class DatagramBatch final {
 public:
  void clear();
  void add(std::span<const std::byte> datagram, const sockaddr* address, socklen_t address_size);
  /// Many datagrams to one address as one message: the kernel cuts `bytes` every `cut` bytes, the
  /// last may be shorter. Where it cannot (old kernel, no such device), `send` cuts.
  void add_cut(std::span<const std::byte> bytes, std::size_t cut, const sockaddr* address,
               socklen_t address_size);
  /// A datagram that the socket does not take (its buffer is full, no way to the address) is left
  /// out; the others go.
  void send(int socket);

  /// Messages so far: one per `add`, one or more per `add_cut`.
  [[nodiscard]] std::size_t size() const { return messages_.size(); }
  /// After `send`: did the socket take the i-th one, all of it?
  [[nodiscard]] bool sent(std::size_t i) const { return sent_[i]; }

 private:
  struct Cut {
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(std::uint16_t))> control{};
    std::size_t bytes{0};  ///< 0: not cut.
  };
  void point_at_memory();
  [[nodiscard]] bool send_cut_by_hand(int socket, std::size_t i) const;

  std::vector<SocketAddress> addresses_;
  std::vector<iovec> pieces_;
  std::vector<Cut> cuts_;
  std::vector<mmsghdr> messages_;
  std::vector<bool> sent_;
};

/// What a client of a TCP server gets by UDP: which messages of the batch under way are its, and
/// what became of them.
class DatagramShare final {
 public:
  /// Nothing in this batch.
  void clear() { begin_ = end_ = 0; }
  void open(const DatagramBatch& batch) { begin_ = batch.size(); }
  void close(const DatagramBatch& batch) { end_ = batch.size(); }
  /// After the batch was sent: a frame counts when the socket took all of its messages.
  void settle(const DatagramBatch& batch);
  /// A frame too long for any datagram.
  void drop() { ++dropped_; }

  [[nodiscard]] std::uint64_t frames_sent() const { return sent_; }
  [[nodiscard]] std::uint64_t frames_dropped() const { return dropped_; }

 private:
  std::size_t begin_{0};
  std::size_t end_{0};
  std::uint64_t sent_{0};
  std::uint64_t dropped_{0};
};

}  // namespace fiducap::net
