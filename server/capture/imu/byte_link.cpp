#include "capture/imu/byte_link.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.hpp"
#include "middleware/net/listening_ports.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kHeaders = 28;  // IPv4 and UDP

Expected<int> open_udp_socket(const LinkConfig& config) {
  const net::Peer own(net::parse_address(config.address).value_or(0), config.port);
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  net::SocketAddress address(own, true);
  if (descriptor >= 0 && ::bind(descriptor, address.data(), address.size()) == 0) return descriptor;
  const int reason = errno;
  if (descriptor >= 0) ::close(descriptor);
  const std::string why =
      reason == EADDRINUSE
          ? "the UDP port is used by " + net::owner_of(config.port, net::Transport::kUdp) +
                ": end that, or use another port on both sides"
      : reason == EADDRNOTAVAIL
          ? "this machine has no such address: use one of its own, or 0.0.0.0 for all"
          : std::string("the UDP port cannot be opened: ") + std::strerror(reason);
  return fail(ErrorCode::kUnavailable, why,
              own.port > 0 ? net::text_of(own) : net::address_text(own));
}

constexpr std::size_t kEnoughBytes = 4096;
constexpr Duration kLongSilence = std::chrono::seconds(5);
constexpr double kMostlyText = 0.9;  // of random bytes 0.38 are printable
constexpr std::uint64_t kWindow = 1000;
constexpr double kDisturbed = 0.01;

}  // namespace

std::optional<net::Peer> parse_link_peer(const std::string& text) {
  if (const auto address = net::parse_address(text)) return net::Peer(*address, 0);
  return net::parse_peer(text);
}

Expected<ByteLink> ByteLink::open(const LinkConfig& config) {
  const bool is_serial = !config.device.empty();
  auto descriptor =
      is_serial ? open_serial_port(config.device, config.baud) : open_udp_socket(config);
  if (!descriptor) return tl::unexpected(descriptor.error());
  const auto peer = config.peer.empty() ? std::nullopt : parse_link_peer(config.peer);
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
  if (is_serial_) {
    const ssize_t size = ::read(descriptor_, buffer_.data(), buffer_.size());
    if (size > 0) return Piece{std::span(buffer_).first(static_cast<std::size_t>(size)), {}};
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) return Piece{};
    return fail(ErrorCode::kClosed,
                "the serial device is disconnected: was it unplugged, or did it restart?", name_);
  }
  net::SocketAddress address;
  socklen_t length = address.size();
  const ssize_t size =
      ::recvfrom(descriptor_, buffer_.data(), buffer_.size(), 0, address.data(), &length);
  const net::Peer from = address.peer();
  if (size <= 0 || (peer_ && !is_configured(from))) return Piece{};
  rule_.count_received(from, static_cast<std::size_t>(size) + kHeaders, {});
  return Piece{std::span(buffer_).first(static_cast<std::size_t>(size)), from};
}

void ByteLink::write(std::span<const std::byte> bytes, const net::Peer& to, bool proven) {
  const bool may_go = is_serial_ || proven || is_configured(to) ||
                      rule_.may_answer_untrusted(to, bytes.size() + kHeaders);
  if (!may_go) return;
  net::SocketAddress address(to, true);
  [[maybe_unused]] const ssize_t sent =
      is_serial_
          ? ::write(descriptor_, bytes.data(), bytes.size())
          : ::sendto(descriptor_, bytes.data(), bytes.size(), 0, address.data(), address.size());
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
