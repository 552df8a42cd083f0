#pragma once

#include <sys/socket.h>
#include <sys/uio.h>

#include <cstddef>
#include <span>
#include <vector>

namespace fiducap::native {

/// Sends the same datagrams to one address after the other: one system call each, never waiting.
/// Keeps its memory, so that nothing is allocated per frame.
class DatagramSender final {
 public:
  /// What the next calls of `send_to` send. @pre the bytes live until then
  void load(std::span<const std::span<const std::byte>> datagrams);
  /// @return false when the socket did not take all of them (its buffer is full, or there is no way to the address)
  [[nodiscard]] bool send_to(int socket, const sockaddr* address, socklen_t size);

 private:
  std::vector<iovec> pieces_;
  std::vector<mmsghdr> messages_;
};

}  // namespace fiducap::native
