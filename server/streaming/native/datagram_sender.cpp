#include "streaming/native/datagram_sender.hpp"

namespace fiducap::native {

void DatagramSender::load(std::span<const std::span<const std::byte>> datagrams) {
  pieces_.clear();
  for (const auto& datagram : datagrams) {
    // sendmmsg only reads; iovec is shared with calls that write, hence its pointer to non-const.
    pieces_.push_back({const_cast<std::byte*>(datagram.data()), datagram.size()});
  }
  messages_.assign(datagrams.size(), mmsghdr{});
  for (std::size_t i = 0; i < messages_.size(); ++i) {
    messages_[i].msg_hdr.msg_iov = &pieces_[i];
    messages_[i].msg_hdr.msg_iovlen = 1;
  }
}

bool DatagramSender::send_to(int socket, const sockaddr* address, socklen_t size) {
  for (auto& message : messages_) {
    message.msg_hdr.msg_name = const_cast<sockaddr*>(address);
    message.msg_hdr.msg_namelen = size;
  }
  const int sent = ::sendmmsg(socket, messages_.data(), static_cast<unsigned>(messages_.size()),
                              MSG_DONTWAIT | MSG_NOSIGNAL);
  return sent == static_cast<int>(messages_.size());
}

}  // namespace fiducap::native
