#include "streaming/net/udp_server.hpp"

#include <linux/errqueue.h>
#include <netinet/in.h>
#include <netinet/udp.h>

#include <algorithm>
#include <boost/asio/steady_timer.hpp>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/log.hpp"
#include "streaming/net/bind.hpp"
#include "streaming/net/repeated_wait.hpp"

namespace fiducap::net {

namespace {

constexpr std::size_t kMostPerCall = 1024;  // UIO_MAXIOV
constexpr std::size_t kMostCuts = 64;       // UDP_MAX_SEGMENTS
constexpr std::size_t kMostBytes = 65'507;
#ifndef UDP_SEGMENT
constexpr int UDP_SEGMENT = 103;  // since Linux 4.18; older C libraries do not name it
#endif

namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

constexpr int kDatagramsInARow = 64;
constexpr int kMostOtherErrors = 64;  // skipped at once while looking for refused peers
constexpr auto kPause = std::chrono::milliseconds(100);  // after a failed wait, so as not to spin

using PacketInfo = std::array<std::byte, CMSG_SPACE(sizeof(in_pktinfo))>;

template <typename T>
std::optional<T> control_value(msghdr& message, int type) {
  for (cmsghdr* one = CMSG_FIRSTHDR(&message); one != nullptr; one = CMSG_NXTHDR(&message, one)) {
    if (one->cmsg_level != IPPROTO_IP || one->cmsg_type != type) continue;
    T value;
    std::memcpy(&value, CMSG_DATA(one), sizeof(value));
    return value;
  }
  return std::nullopt;
}

/// @param memory  of CMSG_SPACE(sizeof(value)), aligned
template <typename Memory, typename T>
void put_control(msghdr& message, Memory& memory, int level, int type, const T& value) {
  message.msg_control = memory.data();
  message.msg_controllen = memory.size();
  cmsghdr* header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = level;
  header->cmsg_type = type;
  header->cmsg_len = CMSG_LEN(sizeof(value));
  std::memcpy(CMSG_DATA(header), &value, sizeof(value));
}

bool set(int socket, int option, int value) {
  return ::setsockopt(socket, IPPROTO_IP, option, &value, sizeof(value)) == 0;
}

}  // namespace

void DatagramBatch::clear() {
  addresses_.clear();
  pieces_.clear();
  cuts_.clear();
  messages_.clear();
  sent_.clear();
}

void DatagramBatch::add(std::span<const std::byte> datagram, const SocketAddress& address) {
  // sendmmsg does not write; its structures are shared with calls that do.
  addresses_.push_back(address);
  pieces_.push_back({const_cast<std::byte*>(datagram.data()), datagram.size()});
  mmsghdr message{};
  message.msg_hdr.msg_iovlen = 1;
  messages_.push_back(message);
  cuts_.emplace_back();
}

void DatagramBatch::add_cut(std::span<const std::byte> bytes, std::size_t cut,
                            const SocketAddress& address) {
  const std::size_t most = cut * std::min(kMostCuts, std::max<std::size_t>(1, kMostBytes / cut));
  while (!bytes.empty()) {
    const auto next = bytes.first(std::min(most, bytes.size()));
    bytes = bytes.subspan(next.size());
    add(next, address);
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
    put_control(message, cuts_[i].control, IPPROTO_UDP, UDP_SEGMENT,
                static_cast<std::uint16_t>(cuts_[i].bytes));
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
      // IP_RECVERR reports the closed port of an earlier datagram; this one was not tried yet.
      if (errno == ECONNREFUSED && !std::exchange(tried_again, true)) continue;
      tried_again = false;
      const bool kernel_cannot_cut =
          errno == EINVAL || errno == EIO || errno == EOPNOTSUPP || errno == EMSGSIZE;
      if (kernel_cannot_cut && cuts_[next].bytes > 0) sent_[next] = send_cut_by_hand(socket, next);
      ++next;  // skips the refused one
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

/// Shared with the pending handler, which may outlive the server.
struct UdpServer::State final : RepeatedWait, std::enable_shared_from_this<State> {
  State(udp::socket opened, const UdpOptions& given)
      : options(given),
        socket(std::move(opened)),
        timer(socket.get_executor()),
        ipv4(socket.local_endpoint().address().is_v4()),
        port(socket.local_endpoint().port()),
        incoming(given.longest) {}

  void resume() override {
    if (waiting || !handler || !socket.is_open()) return;
    socket.async_wait(udp::socket::wait_read, [self = shared_from_this(), token = waiting.begin()](
                                                  const error_code& error) mutable {
      token.release();
      if (!self->socket.is_open()) return;
      if (error) return self->pause();
      self->read();
      self->resume();
    });
  }

  void pause() {
    timer.expires_after(kPause);
    timer.async_wait(
        [self = shared_from_this(), token = waiting.begin()](const error_code&) mutable {
          token.release();
          self->resume();
        });
  }

  void read() {
    for (int i = 0; i < kDatagramsInARow && socket.is_open() && read_one(); ++i) continue;
  }

  [[nodiscard]] bool read_one() {
    sockaddr_in6 from{};
    iovec piece{incoming.data(), incoming.size()};
    alignas(cmsghdr) PacketInfo control{};
    msghdr message{};
    message.msg_name = &from;
    message.msg_namelen = sizeof(from);
    message.msg_iov = &piece;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = ::recvmsg(socket.native_handle(), &message, MSG_DONTWAIT);
    // Another error belongs to an earlier datagram of ours that was unreachable.
    if (size < 0) return errno != EAGAIN && errno != EWOULDBLOCK;
    const SocketAddress peer(reinterpret_cast<const sockaddr*>(&from), message.msg_namelen);
    const auto info = control_value<in_pktinfo>(message, IP_PKTINFO);
    const Datagram datagram{std::span(incoming).first(static_cast<std::size_t>(size)), peer.peer(),
                            info ? ntohl(info->ipi_spec_dst.s_addr) : INADDR_ANY};
    log::guarded(
        options.protocol, [&] { return "datagram from " + text_of(datagram.from); },
        [&] { handler(datagram); });
    return true;
  }

  UdpOptions options;
  udp::socket socket;
  asio::steady_timer timer;
  bool ipv4;
  std::uint16_t port;
  std::vector<std::byte> incoming;
  Handler handler;  ///< Empty: not started.
  PendingWait waiting;
  DatagramBatch batch;
};

UdpServer::UdpServer(std::shared_ptr<State> state) : state_(std::move(state)) {}
UdpServer::~UdpServer() {
  if (state_) stop();
}

Expected<UdpServer> UdpServer::open(asio::io_context& io, const BindTarget& target,
                                    const UdpOptions& options) {
  auto socket = bind_udp(io, target, options.shared);
  if (!socket) return tl::unexpected(socket.error());
  const int native = socket->native_handle();
  set(native, IP_PKTINFO, 1);
  set(native, IP_MULTICAST_ALL, 0);  // no datagrams of groups that other programs have joined
  if (options.broadcasts) {
    error_code ignored;  // a send to a broadcast address is then refused, counted
    socket->set_option(asio::socket_base::broadcast(true), ignored);
  }
  if (options.fragments) set(native, IP_MTU_DISCOVER, IP_PMTUDISC_DONT);
  if (options.reports_refusals) set(native, IP_RECVERR, 1);
  if (options.send_buffer_bytes > 0) {
    error_code ignored;  // the kernel grants what net.core.wmem_max allows
    socket->set_option(asio::socket_base::send_buffer_size(options.send_buffer_bytes), ignored);
  }
  const auto state = std::make_shared<State>(std::move(*socket), options);
  register_wait(io, state);
  return UdpServer(state);
}

void UdpServer::start(Handler handler) {
  state_->handler = std::move(handler);
  state_->resume();
}

std::error_code UdpServer::use_multicast(std::uint32_t interface, int ttl) {
  const int native = state_->socket.native_handle();
  const in_addr leave_by{htonl(interface)};
  const bool done = (interface == INADDR_ANY || ::setsockopt(native, IPPROTO_IP, IP_MULTICAST_IF,
                                                             &leave_by, sizeof(leave_by)) == 0) &&
                    set(native, IP_MULTICAST_LOOP, 1) && set(native, IP_MULTICAST_TTL, ttl);
  return done ? std::error_code{} : std::error_code{errno, std::generic_category()};
}

void UdpServer::join(const Peer& group, std::uint32_t interface) {
  ip_mreqn membership{};
  membership.imr_multiaddr.s_addr = htonl(group.ipv4());
  membership.imr_address.s_addr = htonl(interface);
  ::setsockopt(state_->socket.native_handle(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership,
               sizeof(membership));
}

void UdpServer::send(std::span<const std::byte> bytes, const Peer& to, std::uint32_t from) {
  SocketAddress address(to, state_->ipv4);
  iovec piece{const_cast<std::byte*>(bytes.data()), bytes.size()};  // sendmsg only reads
  alignas(cmsghdr) PacketInfo control{};
  msghdr message{};
  message.msg_name = address.data();
  message.msg_namelen = address.size();
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  if (from != INADDR_ANY) {
    in_pktinfo info{};
    info.ipi_spec_dst.s_addr = htonl(from);
    put_control(message, control, IPPROTO_IP, IP_PKTINFO, info);
  }
  ::sendmsg(state_->socket.native_handle(), &message, MSG_DONTWAIT | MSG_NOSIGNAL);
}

DatagramBatch& UdpServer::batch() { return state_->batch; }

void UdpServer::add(std::span<const std::byte> bytes, const Peer& to) {
  state_->batch.add(bytes, SocketAddress(to, state_->ipv4));
}

void UdpServer::add_cut(std::span<const std::byte> bytes, std::size_t cut, const Peer& to) {
  state_->batch.add_cut(bytes, cut, SocketAddress(to, state_->ipv4));
}

void UdpServer::send_batch() {
  if (state_->batch.size() > 0) state_->batch.send(state_->socket.native_handle());
}

std::optional<Peer> UdpServer::next_refused() {
  for (int i = 0; i < kMostOtherErrors; ++i) {
    sockaddr_in6 to{};
    alignas(cmsghdr) std::array<std::byte, 512> control{};
    msghdr message{};
    message.msg_name = &to;
    message.msg_namelen = sizeof(to);
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    if (::recvmsg(state_->socket.native_handle(), &message, MSG_ERRQUEUE | MSG_DONTWAIT) < 0)
      return std::nullopt;
    const auto error = control_value<sock_extended_err>(message, IP_RECVERR);
    if (error && error->ee_errno == ECONNREFUSED)
      return SocketAddress(reinterpret_cast<const sockaddr*>(&to), message.msg_namelen).peer();
  }
  return std::nullopt;
}

void UdpServer::stop() {
  error_code ignored;
  state_->timer.cancel(ignored);
  state_->socket.close(ignored);
}

bool UdpServer::is_open() const { return state_->socket.is_open(); }
std::uint16_t UdpServer::port() const { return state_->port; }

}  // namespace fiducap::net
