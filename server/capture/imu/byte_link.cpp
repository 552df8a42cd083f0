#include "capture/imu/byte_link.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>

namespace fiducap {

namespace {

constexpr std::size_t kHeaders = 28;  // IPv4 and UDP

net::Peer peer_of(const LinkPeer& peer) { return {peer.address, peer.port}; }

sockaddr_in address_of(const LinkPeer& peer) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(peer.address);
  address.sin_port = htons(peer.port);
  return address;
}

Expected<int> open_udp_socket(const LinkConfig& config) {
  const LinkPeer own{parse_peer(config.address).value_or(LinkPeer{}).address, config.port};
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const sockaddr_in address = address_of(own);
  if (descriptor >= 0 &&
      ::bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0)
    return descriptor;
  const int reason = errno;
  if (descriptor >= 0) ::close(descriptor);
  const std::string why =
      reason == EADDRINUSE
          ? "another program has the UDP port (a ground station?): close it, or use "
            "another port on both sides"
      : reason == EADDRNOTAVAIL
          ? "this machine has no such address: use one of its own, or 0.0.0.0 for all"
          : std::string("the UDP port cannot be had: ") + std::strerror(reason);
  return fail(ErrorCode::kUnavailable, why, text_of(own));
}

}  // namespace

std::optional<LinkPeer> parse_peer(std::string_view text) {
  const auto colon = text.find(':');
  const std::string host(text.substr(0, colon));
  in_addr address{};
  if (::inet_pton(AF_INET, host.c_str(), &address) != 1) return std::nullopt;
  LinkPeer peer{ntohl(address.s_addr), 0};
  if (colon == std::string_view::npos) return peer;
  const std::string_view digits = text.substr(colon + 1);
  const char* end = digits.data() + digits.size();
  const auto [stopped, failure] = std::from_chars(digits.data(), end, peer.port);
  return failure == std::errc{} && stopped == end && peer.port > 0 ? std::optional(peer)
                                                                   : std::nullopt;
}

std::string text_of(const LinkPeer& peer) {
  std::array<char, INET_ADDRSTRLEN> address{};
  const in_addr raw{htonl(peer.address)};
  ::inet_ntop(AF_INET, &raw, address.data(), address.size());
  std::string text = address.data();
  if (peer.port > 0) text.append(":").append(std::to_string(peer.port));
  return text;
}

bool LinkConfig::takes_the_first_sender() const {
  return device.empty() && peer.empty() && !address.starts_with("127.");
}

void LinkConfig::check(Checker& checker) const {
  const bool by_udp = device.empty();
  const auto other = parse_peer(peer);
  const auto own = parse_peer(address);
  const bool speaks_first = other && other->port > 0;
  checker
      .require(device.empty() || device.starts_with('/'), "device", '"' + device + '"',
               "must be the path of a serial device, e.g. /dev/ttyACM0")
      .within("baud", baud, 50, 12'000'000)
      .require(by_udp || (port == 0 && peer.empty()), "port", port,
               "must not be given together with device: it is a serial line or UDP")
      .require(!by_udp || port > 0 || speaks_first, "port", port,
               "must be the UDP port where the readings come in (or give device, a serial line)")
      .require(own && own->port == 0, "address", '"' + address + '"',
               "must be an IPv4 address of this machine, or 0.0.0.0 for all")
      .require(peer.empty() || other, "peer", '"' + peer + '"',
               "must be an IPv4 address, e.g. 192.168.1.20 or 192.168.1.20:14580");
}

Expected<ByteLink> ByteLink::open(const LinkConfig& config) {
  const bool is_serial = !config.device.empty();
  auto descriptor =
      is_serial ? open_serial_port(config.device, config.baud) : open_udp_socket(config);
  if (!descriptor) return tl::unexpected(descriptor.error());
  const auto peer = config.peer.empty() ? std::nullopt : parse_peer(config.peer);
  ByteLink link(*descriptor, config.device, is_serial, peer);
  if (!is_serial) link.name_ = "UDP port " + std::to_string(link.port());
  return link;
}

ByteLink::~ByteLink() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Expected<ByteLink::Piece> ByteLink::read(Duration patience) {
  pollfd wait{descriptor_, POLLIN, 0};
  const auto left_ms = std::chrono::ceil<std::chrono::milliseconds>(patience).count();
  if (::poll(&wait, 1, static_cast<int>(left_ms)) <= 0) return Piece{};
  return is_serial_ ? read_serial() : Expected<Piece>(read_datagram());
}

Expected<ByteLink::Piece> ByteLink::read_serial() {
  const ssize_t size = ::read(descriptor_, buffer_.data(), buffer_.size());
  if (size > 0) return Piece{std::span(buffer_).first(static_cast<std::size_t>(size)), {}};
  if (size < 0 && (errno == EAGAIN || errno == EINTR)) return Piece{};
  return fail(ErrorCode::kClosed, "the serial device is gone: was it unplugged, or did it restart?",
              name_);
}

/// One that is not to be heard is nothing.
ByteLink::Piece ByteLink::read_datagram() {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  const ssize_t size = ::recvfrom(descriptor_, buffer_.data(), buffer_.size(), 0,
                                  reinterpret_cast<sockaddr*>(&address), &length);
  if (size <= 0) return {};
  const LinkPeer from{ntohl(address.sin_addr.s_addr), ntohs(address.sin_port)};
  if (peer_ && !is_configured(from)) return {};
  rule_.heard(peer_of(from), static_cast<std::size_t>(size) + kHeaders, {});
  return {std::span<const std::byte>(buffer_).first(static_cast<std::size_t>(size)), from};
}

bool ByteLink::is_configured(const LinkPeer& peer) const {
  return peer_ && peer_->address == peer.address && (peer_->port == 0 || peer_->port == peer.port);
}

void ByteLink::write(std::span<const std::byte> bytes, const LinkPeer& to, bool proven) {
  const bool may_go = is_serial_ || proven || is_configured(to) ||
                      rule_.may_answer_stranger(peer_of(to), bytes.size() + kHeaders);
  if (!may_go) return;
  const sockaddr_in address = address_of(to);
  [[maybe_unused]] const ssize_t sent =
      is_serial_ ? ::write(descriptor_, bytes.data(), bytes.size())
                 : ::sendto(descriptor_, bytes.data(), bytes.size(), 0,
                            reinterpret_cast<const sockaddr*>(&address), sizeof address);
}

std::uint16_t ByteLink::port() const {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  if (is_serial_ || ::getsockname(descriptor_, reinterpret_cast<sockaddr*>(&address), &length) != 0)
    return 0;
  return ntohs(address.sin_port);
}

}  // namespace fiducap
