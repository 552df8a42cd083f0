#include "streaming/net/datagram_batch.hpp"

#include <netinet/in.h>
#include <netinet/udp.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace fiducap::net {

namespace {

constexpr std::size_t kMostPerCall = 1024;  // UIO_MAXIOV
constexpr std::size_t kMostCuts = 64;       // UDP_MAX_SEGMENTS
constexpr std::size_t kMostBytes = 65'507;
#ifndef UDP_SEGMENT
constexpr int UDP_SEGMENT = 103;  // since Linux 4.18; older C libraries do not name it
#endif

}  // namespace

void DatagramBatch::clear() {
  addresses_.clear();
  pieces_.clear();
  cuts_.clear();
  messages_.clear();
  sent_.clear();
}

void DatagramBatch::add(std::span<const std::byte> datagram, const sockaddr* address,
                        socklen_t address_size) {
  // sendmmsg only reads; its structures are shared with calls that write, hence the pointers to
  // non-const.
  addresses_.emplace_back(address, address_size);
  pieces_.push_back({const_cast<std::byte*>(datagram.data()), datagram.size()});
  mmsghdr message{};
  message.msg_hdr.msg_iovlen = 1;
  messages_.push_back(message);
  cuts_.emplace_back();
}

void DatagramBatch::add_cut(std::span<const std::byte> bytes, std::size_t cut,
                            const sockaddr* address, socklen_t address_size) {
  const std::size_t most = cut * std::min(kMostCuts, std::max<std::size_t>(1, kMostBytes / cut));
  while (!bytes.empty()) {
    const auto next = bytes.first(std::min(most, bytes.size()));
    bytes = bytes.subspan(next.size());
    add(next, address, address_size);
    if (next.size() <= cut) continue;
    cuts_.back().bytes = cut;
  }
}

void DatagramBatch::point_at_memory() {
  for (std::size_t i = 0; i < messages_.size(); ++i) {
    msghdr& message = messages_[i].msg_hdr;
    message.msg_name = addresses_[i].data();
    message.msg_namelen = addresses_[i].size();
    message.msg_iov = &pieces_[i];
    if (cuts_[i].bytes == 0) continue;
    message.msg_control = cuts_[i].control.data();
    message.msg_controllen = cuts_[i].control.size();
    cmsghdr* control = CMSG_FIRSTHDR(&message);
    control->cmsg_level = IPPROTO_UDP;
    control->cmsg_type = UDP_SEGMENT;
    control->cmsg_len = CMSG_LEN(sizeof(std::uint16_t));
    const auto cut = static_cast<std::uint16_t>(cuts_[i].bytes);
    std::memcpy(CMSG_DATA(control), &cut, sizeof(cut));
  }
}

bool DatagramBatch::send_cut_by_hand(int socket, std::size_t i) const {
  const msghdr& message = messages_[i].msg_hdr;
  const std::span all(static_cast<const std::byte*>(pieces_[i].iov_base), pieces_[i].iov_len);
  bool whole = true;
  for (std::size_t begin = 0; begin < all.size(); begin += cuts_[i].bytes) {
    const auto part = all.subspan(begin, std::min(cuts_[i].bytes, all.size() - begin));
    const auto n = ::sendto(socket, part.data(), part.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                            static_cast<const sockaddr*>(message.msg_name), message.msg_namelen);
    whole = whole && n == static_cast<ssize_t>(part.size());
  }
  return whole;
}

void DatagramBatch::send(int socket) {
  sent_.assign(messages_.size(), false);
  point_at_memory();
  std::size_t next = 0;
  bool tried_again = false;
  while (next < messages_.size()) {
    const std::size_t wanted = std::min(messages_.size() - next, kMostPerCall);
    const int n = ::sendmmsg(socket, &messages_[next], static_cast<unsigned>(wanted),
                             MSG_DONTWAIT | MSG_NOSIGNAL);
    if (n < 0) {
      if (errno == EINTR) continue;
      // With IP_RECVERR: an earlier datagram found its port closed. This one was not tried yet.
      if (errno == ECONNREFUSED && !std::exchange(tried_again, true)) continue;
      tried_again = false;
      const bool kernel_cannot_cut =
          errno == EINVAL || errno == EIO || errno == EOPNOTSUPP || errno == EMSGSIZE;
      if (kernel_cannot_cut && cuts_[next].bytes > 0) sent_[next] = send_cut_by_hand(socket, next);
      ++next;  // the first one was refused: an unreachable peer must not cost the others their
               // frame
      continue;
    }
    tried_again = false;
    std::fill_n(sent_.begin() + static_cast<std::ptrdiff_t>(next), n, true);
    next += static_cast<std::size_t>(n);
  }
}

void DatagramShare::settle(const DatagramBatch& batch) {
  if (begin_ == end_) return;
  bool whole = true;
  for (std::size_t i = begin_; i < end_; ++i) whole = whole && batch.sent(i);
  ++(whole ? sent_ : dropped_);
  clear();
}

}  // namespace fiducap::net
