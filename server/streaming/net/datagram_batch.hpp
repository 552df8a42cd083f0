#pragma once

#include <sys/socket.h>
#include <sys/uio.h>

#include <cstddef>
#include <span>
#include <vector>

namespace fiducap::net {

/// Many datagrams to many addresses by as few system calls as the kernel allows, never waiting.
///
/// `clear`, `add` for every datagram, `send`. Keeps its memory, so that nothing is allocated per frame. Bytes and
/// addresses are only pointed at: they must live until `send`.
class DatagramBatch final {
 public:
  void clear();
  void add(std::span<const std::byte> datagram, const sockaddr* address, socklen_t address_size);
  /// A datagram that the socket does not take (its buffer is full, no way to the address) is left out; the others go.
  void send(int socket);

  [[nodiscard]] std::size_t size() const { return messages_.size(); }
  /// After `send`: did the socket take the i-th one?
  [[nodiscard]] bool sent(std::size_t i) const { return sent_[i]; }

 private:
  std::vector<iovec> pieces_;
  std::vector<mmsghdr> messages_;
  std::vector<bool> sent_;
};

}  // namespace fiducap::net
