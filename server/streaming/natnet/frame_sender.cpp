#include "streaming/natnet/frame_sender.hpp"

#include <linux/errqueue.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "base/assert.hpp"
#include "streaming/natnet/interfaces.hpp"
#include "streaming/natnet/registry.hpp"
#include "streaming/net/bind.hpp"

namespace fiducap::natnet {

namespace {

// 1000 bodies for 64 clients at once are 2.5 MB; the kernel grants what net.core.wmem_max allows.
constexpr int kSendBuffer = 16 << 20;

bool set(int socket, int option, int value) {
  return ::setsockopt(socket, IPPROTO_IP, option, &value, sizeof(value)) == 0;
}

Expected<void> use_multicast(int socket, const NatNetConfig& config) {
  const auto card = multicast_interface(config);
  if (!card) return tl::unexpected(card.error());
  const in_addr leave_by{htonl(*card)};
  const bool done = ::setsockopt(socket, IPPROTO_IP, IP_MULTICAST_IF, &leave_by, sizeof(leave_by)) == 0 &&
                    set(socket, IP_MULTICAST_LOOP, 1) && set(socket, IP_MULTICAST_TTL, config.multicast_ttl);
  if (done) return {};
  return fail(ErrorCode::kUnavailable, "cannot send multicast by this interface (" + std::string(std::strerror(errno)) +
                                           "); set it to the address of one that can (`ip maddr` lists them)",
              "streaming.natnet.multicast_interface");
}

/// The address one error of the queue is about, when it says that the port is closed.
std::optional<Peer> refused_peer(msghdr& message, const sockaddr_in& to) {
  for (cmsghdr* one = CMSG_FIRSTHDR(&message); one != nullptr; one = CMSG_NXTHDR(&message, one)) {
    if (one->cmsg_level != IPPROTO_IP || one->cmsg_type != IP_RECVERR) continue;
    sock_extended_err error;
    std::memcpy(&error, CMSG_DATA(one), sizeof(error));
    if (error.ee_errno == ECONNREFUSED) return Peer{ntohl(to.sin_addr.s_addr), ntohs(to.sin_port)};
  }
  return std::nullopt;
}

}  // namespace

Expected<FrameSender> FrameSender::open(boost::asio::io_context& io, const NatNetConfig& config) {
  auto socket = net::bind_udp(io, {config.address, 0, "streaming.natnet"});
  if (!socket) return tl::unexpected(socket.error());
  const int native = socket->native_handle();
  set(native, IP_MTU_DISCOVER, IP_PMTUDISC_DONT);
  set(native, IP_RECVERR, 1);
  boost::system::error_code ignored;  // a smaller buffer only means counted drops earlier
  socket->set_option(boost::asio::socket_base::send_buffer_size(kSendBuffer), ignored);
  if (config.multicast) {
    if (const auto ready = use_multicast(native, config); !ready) return tl::unexpected(ready.error());
  }
  const auto most = static_cast<std::size_t>(config.max_clients + Registry::kMaxStrangers) + config.targets.size() + 1;
  return FrameSender(std::move(*socket), most);
}

FrameSender::FrameSender(boost::asio::ip::udp::socket socket, std::size_t most) : socket_(std::move(socket)) {
  addresses_.reserve(most);
}

void FrameSender::clear() {
  batch_.clear();
  addresses_.clear();
}

void FrameSender::add(std::span<const std::byte> frame, const Peer& to) {
  FIDUCAP_ASSERT(addresses_.size() < addresses_.capacity());
  sockaddr_in& address = addresses_.emplace_back();
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(to.address);
  address.sin_port = htons(to.port);
  batch_.add(frame, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
}

std::optional<Peer> FrameSender::next_refused() {
  constexpr int kMostOthers = 64;  // of other errors, skipped at once
  for (int i = 0; i < kMostOthers; ++i) {
    sockaddr_in to{};
    alignas(cmsghdr) std::array<std::byte, 512> control{};
    msghdr message{};
    message.msg_name = &to;
    message.msg_namelen = sizeof(to);
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    if (::recvmsg(socket_.native_handle(), &message, MSG_ERRQUEUE | MSG_DONTWAIT) < 0) return std::nullopt;
    if (const auto peer = refused_peer(message, to)) return peer;
  }
  return std::nullopt;
}

}  // namespace fiducap::natnet
