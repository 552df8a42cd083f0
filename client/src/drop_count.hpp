#pragma once

#include <sys/socket.h>
#include <sys/uio.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace fiducap::sdk {

/// Makes the kernel count datagrams that it drops because the socket's buffer is full. Without
/// support the count stays 0.
inline void count_drops(int fd) {
  const int on = 1;
  ::setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof(on));
}

/// As recvfrom. @param dropped  set when the kernel reports the number dropped so far
inline ssize_t receive_counting_drops(int fd, std::uint8_t* bytes, std::size_t size,
                                      sockaddr_storage* from, std::uint32_t& dropped) {
  iovec piece{bytes, size};
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(std::uint32_t))];
  msghdr message{};
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof(control);
  if (from != nullptr) {
    message.msg_name = from;
    message.msg_namelen = sizeof(*from);
  }
  const ssize_t received = ::recvmsg(fd, &message, MSG_DONTWAIT);
  if (received < 0) return received;
  for (cmsghdr* at = CMSG_FIRSTHDR(&message); at != nullptr; at = CMSG_NXTHDR(&message, at)) {
    if (at->cmsg_level == SOL_SOCKET && at->cmsg_type == SO_RXQ_OVFL) {
      std::memcpy(&dropped, CMSG_DATA(at), sizeof(dropped));
    }
  }
  return received;
}

}  // namespace fiducap::sdk
