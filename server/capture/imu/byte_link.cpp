#include "capture/imu/byte_link.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.hpp"

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
      reason == EADDRINUSE ? "another program uses the UDP port (a ground station?): close it, or "
                             "use another port on both sides"
      : reason == EADDRNOTAVAIL
          ? "this machine has no such address: use one of its own, or 0.0.0.0 for all"
          : std::string("the UDP port cannot be opened: ") + std::strerror(reason);
  return fail(ErrorCode::kUnavailable, why, text_of(own));
}

constexpr std::size_t kEnoughBytes = 4096;
constexpr Duration kLongSilence = std::chrono::seconds(5);
constexpr double kMostlyText = 0.9;  // of random bytes 0.38 are printable
constexpr std::uint64_t kWindow = 1000;
constexpr double kDisturbed = 0.01;

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

Expected<ByteLink::Piece> ByteLink::read(Duration timeout) {
  pollfd wait{descriptor_, POLLIN, 0};
  const auto left_ms = std::chrono::ceil<std::chrono::milliseconds>(timeout).count();
  if (::poll(&wait, 1, static_cast<int>(left_ms)) <= 0) return Piece{};
  return is_serial_ ? read_serial() : Expected<Piece>(read_datagram());
}

Expected<ByteLink::Piece> ByteLink::read_serial() {
  const ssize_t size = ::read(descriptor_, buffer_.data(), buffer_.size());
  if (size > 0) return Piece{std::span(buffer_).first(static_cast<std::size_t>(size)), {}};
  if (size < 0 && (errno == EAGAIN || errno == EINTR)) return Piece{};
  return fail(ErrorCode::kClosed,
              "the serial device is disconnected: was it unplugged, or did it restart?", name_);
}

/// @return an empty piece for other senders
ByteLink::Piece ByteLink::read_datagram() {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  const ssize_t size = ::recvfrom(descriptor_, buffer_.data(), buffer_.size(), 0,
                                  reinterpret_cast<sockaddr*>(&address), &length);
  if (size <= 0) return {};
  const LinkPeer from{ntohl(address.sin_addr.s_addr), ntohs(address.sin_port)};
  if (peer_ && !is_configured(from)) return {};
  rule_.count_received(peer_of(from), static_cast<std::size_t>(size) + kHeaders, {});
  return {std::span<const std::byte>(buffer_).first(static_cast<std::size_t>(size)), from};
}

bool ByteLink::is_configured(const LinkPeer& peer) const {
  return peer_ && peer_->address == peer.address && (peer_->port == 0 || peer_->port == peer.port);
}

void ByteLink::write(std::span<const std::byte> bytes, const LinkPeer& to, bool proven) {
  const bool may_go = is_serial_ || proven || is_configured(to) ||
                      rule_.may_answer_untrusted(peer_of(to), bytes.size() + kHeaders);
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

bool is_printable(std::byte byte) {
  const auto c = static_cast<unsigned char>(byte);
  return (c >= 0x20 && c < 0x7f) || c == '\n' || c == '\r' || c == '\t';
}

std::string LinkWatch::add(std::size_t bytes, std::size_t printable, std::uint64_t units,
                           std::uint64_t broken, Instant now) {
  if (!received_at_) received_at_ = now;
  if (bytes == 0) {
    if (is_silent_ || now - *received_at_ < kLongSilence) return {};
    is_silent_ = true;
    return is_serial_ ? "nothing received for 5 s: does the device send, is its TX wired to this "
                        "end's RX, and is it the right port?"
                      : "nothing received for 5 s: does the device send to this machine's address "
                        "and port, and does no firewall stop it?";
  }
  received_at_ = now;
  std::string message = std::exchange(is_silent_, false) ? "it sends again" : "";
  bytes_ += bytes;
  printable_ += printable;
  broken_ += broken;
  units_ += units;
  broken_in_window_ += broken;
  if (units > 0) {
    bytes_ = printable_ = 0;
    broken_ = 0;
    is_foreign_ = false;
  }
  if (bytes_ >= kEnoughBytes && !std::exchange(is_foreign_, true)) message = foreign_text();
  const std::uint64_t all = units_ + broken_in_window_;
  if (all < kWindow) return message;
  const bool disturbed =
      units_ > 0 && static_cast<double>(broken_in_window_) > kDisturbed * static_cast<double>(all);
  if (disturbed && !is_disturbed_)
    message =
        std::to_string(broken_in_window_) + " of " + std::to_string(all) +
        " have a wrong checksum and are left out: is the line disturbed, or too slow for the data?";
  is_disturbed_ = disturbed;
  units_ = broken_in_window_ = 0;
  return message;
}

std::string LinkWatch::foreign_text() const {
  const std::string none = "no " + unit_ + " among " + std::to_string(bytes_) + " bytes";
  const bool is_text = static_cast<double>(printable_) > kMostlyText * static_cast<double>(bytes_);
  if (broken_ > 0 && is_text)
    return none + ", but " + std::to_string(broken_) +
           " with a wrong checksum: does the device compute it as documented?";
  if (is_text) return none + ", but another text: is it the right device?";
  if (is_serial_) return none + ": is the baud rate right (" + std::to_string(baud_) + " here)?";
  return none + ": another protocol is sent to this port";
}

Expected<std::optional<SensorSample>> ByteSource::next(std::stop_token stop) {
  while (!stop.stop_requested()) {
    if (auto sample = take_sample()) return *sample;
    const auto piece = link_.read(period_);
    if (!piece) return tl::unexpected(piece.error());
    const Instant now = clock_.now();
    if (const auto units = receive(*piece, now)) {
      const auto printable = std::ranges::count_if(piece->bytes, is_printable);
      const std::string message =
          watch_.add(piece->bytes.size(), static_cast<std::size_t>(printable), units->good,
                     units->broken, now);
      if (!message.empty()) log::warning("capture", link_.name() + ": " + message);
    }
    finish(now);
  }
  return std::nullopt;
}

}  // namespace fiducap
