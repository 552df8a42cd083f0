#include "streaming/natnet/command_socket.hpp"

#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>

namespace fiducap::natnet {

namespace {

using PacketInfo = std::array<std::byte, CMSG_SPACE(sizeof(in_pktinfo))>;

/// Our own address that the datagram was sent to, or for a broadcast that of its interface.
std::uint32_t local_address(msghdr& message) {
  for (cmsghdr* one = CMSG_FIRSTHDR(&message); one != nullptr; one = CMSG_NXTHDR(&message, one)) {
    if (one->cmsg_level != IPPROTO_IP || one->cmsg_type != IP_PKTINFO) continue;
    in_pktinfo info;
    std::memcpy(&info, CMSG_DATA(one), sizeof(info));
    return ntohl(info.ipi_spec_dst.s_addr);
  }
  return INADDR_ANY;
}

}  // namespace

Expected<CommandSocket> CommandSocket::open(boost::asio::io_context& io, const net::BindTarget& target,
                                            Channel channel) {
  auto socket = net::bind_udp(io, target);
  if (!socket) return tl::unexpected(socket.error());
  const int on = 1;
  ::setsockopt(socket->native_handle(), IPPROTO_IP, IP_PKTINFO, &on, sizeof(on));
  // A MODELDEF longer than the MTU goes in fragments.
  const int fragment = IP_PMTUDISC_DONT;
  ::setsockopt(socket->native_handle(), IPPROTO_IP, IP_MTU_DISCOVER, &fragment, sizeof(fragment));
  return CommandSocket(std::move(*socket), channel);
}

std::optional<CommandSocket::Received> CommandSocket::receive(std::span<std::byte> buffer) {
  sockaddr_in from{};
  iovec piece{buffer.data(), buffer.size()};
  alignas(cmsghdr) PacketInfo control{};
  msghdr message{};
  message.msg_name = &from;
  message.msg_namelen = sizeof(from);
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  ssize_t size = 0;
  do {
    size = ::recvmsg(socket_.native_handle(), &message, MSG_DONTWAIT);
  } while (size < 0 && errno == EINTR);
  if (size < 0) return std::nullopt;
  return Received{buffer.first(static_cast<std::size_t>(size)), Peer{ntohl(from.sin_addr.s_addr), ntohs(from.sin_port)},
                  local_address(message)};
}

void CommandSocket::send(std::span<const std::byte> datagram, const Peer& to, std::uint32_t from) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(to.address);
  address.sin_port = htons(to.port);
  iovec piece{const_cast<std::byte*>(datagram.data()), datagram.size()};  // sendmsg only reads
  alignas(cmsghdr) PacketInfo control{};
  msghdr message{};
  message.msg_name = &address;
  message.msg_namelen = sizeof(address);
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  if (from != INADDR_ANY) {
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = IPPROTO_IP;
    header->cmsg_type = IP_PKTINFO;
    header->cmsg_len = CMSG_LEN(sizeof(in_pktinfo));
    in_pktinfo info{};
    info.ipi_spec_dst.s_addr = htonl(from);
    std::memcpy(CMSG_DATA(header), &info, sizeof(info));
  }
  ::sendmsg(socket_.native_handle(), &message, MSG_DONTWAIT | MSG_NOSIGNAL);
}

}  // namespace fiducap::natnet
