#include "streaming/net/datagram_batch.hpp"

#include <algorithm>
#include <cerrno>
#include <utility>

namespace fiducap::net {

namespace {

constexpr std::size_t kMostPerCall = 1024;  // UIO_MAXIOV

}  // namespace

void DatagramBatch::clear() {
  pieces_.clear();
  messages_.clear();
  sent_.clear();
}

void DatagramBatch::add(std::span<const std::byte> datagram, const sockaddr* address, socklen_t address_size) {
  // sendmmsg only reads; its structures are shared with calls that write, hence the pointers to non-const.
  pieces_.push_back({const_cast<std::byte*>(datagram.data()), datagram.size()});
  mmsghdr message{};
  message.msg_hdr.msg_name = const_cast<sockaddr*>(address);
  message.msg_hdr.msg_namelen = address_size;
  message.msg_hdr.msg_iovlen = 1;
  messages_.push_back(message);
}

void DatagramBatch::send(int socket) {
  sent_.assign(messages_.size(), false);
  for (std::size_t i = 0; i < messages_.size(); ++i) messages_[i].msg_hdr.msg_iov = &pieces_[i];
  std::size_t next = 0;
  bool tried_again = false;
  while (next < messages_.size()) {
    const std::size_t wanted = std::min(messages_.size() - next, kMostPerCall);
    const int n = ::sendmmsg(socket, &messages_[next], static_cast<unsigned>(wanted), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (n < 0) {
      if (errno == EINTR) continue;
      // With IP_RECVERR: an earlier datagram found its port closed. This one was not tried yet.
      if (errno == ECONNREFUSED && !std::exchange(tried_again, true)) continue;
      tried_again = false;
      ++next;  // the first one was refused: an unreachable peer must not cost the others their frame
      continue;
    }
    tried_again = false;
    std::fill_n(sent_.begin() + static_cast<std::ptrdiff_t>(next), n, true);
    next += static_cast<std::size_t>(n);
  }
}

}  // namespace fiducap::net
