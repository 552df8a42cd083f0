#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/imu/link_config.hpp"
#include "middleware/net/sender_rule.hpp"

namespace fiducap {

/// The other end of a UDP link; all zero: of a serial line.
struct LinkPeer {
  std::uint32_t address{0};  ///< In this machine's byte order.
  std::uint16_t port{0};

  friend bool operator==(const LinkPeer&, const LinkPeer&) = default;
};

/// `192.168.1.20` or `192.168.1.20:14580`; without a port it is 0. nullopt: neither.
[[nodiscard]] std::optional<LinkPeer> parse_peer(std::string_view text);
[[nodiscard]] std::string text_of(const LinkPeer& peer);

/// A serial line, for this process alone, or a UDP socket.
///
/// Opening a serial line raises DTR, as Linux always does: boards with auto-reset start again,
/// once. Closing it leaves DTR raised, so that opening it again does not restart them. What had
/// waited in the line before is thrown away.
class ByteLink final {
 public:
  /// @return Error naming device or port, and what to do
  [[nodiscard]] static Expected<ByteLink> open(const LinkConfig& config);
  ByteLink(ByteLink&& other) noexcept
      : descriptor_(std::exchange(other.descriptor_, -1)),
        name_(std::move(other.name_)),
        is_serial_(other.is_serial_),
        peer_(other.peer_),
        rule_(std::move(other.rule_)) {}
  ByteLink& operator=(ByteLink&&) = delete;
  ~ByteLink();

  struct Piece {
    std::span<const std::byte> bytes;  ///< Empty: nothing came. Valid until the next read.
    LinkPeer from{};
  };
  /// Waits for bytes, at most so long.   @return Error kClosed when the line is gone
  [[nodiscard]] Expected<Piece> read(Duration patience);
  /// Never waits; what the line does not take is lost. Over UDP an address gets no more than three
  /// times the bytes of IP that came in its name, unless it is the configured peer's or proven.
  /// @param to  ignored by a serial line   @param proven  it has answered what only it could read
  void write(std::span<const std::byte> bytes, const LinkPeer& to, bool proven = false);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool is_serial() const { return is_serial_; }
  /// UDP: the port that it listens on.
  [[nodiscard]] std::uint16_t port() const;

 private:
  ByteLink(int descriptor, std::string name, bool is_serial, std::optional<LinkPeer> peer)
      : descriptor_(descriptor), name_(std::move(name)), is_serial_(is_serial), peer_(peer) {}
  [[nodiscard]] Expected<Piece> read_serial();
  [[nodiscard]] Piece read_datagram();
  [[nodiscard]] bool is_configured(const LinkPeer& peer) const;

  int descriptor_;
  std::string name_;
  bool is_serial_;
  std::optional<LinkPeer> peer_;  ///< Nobody else is heard; port 0: any of its ports.
  // Being on an attached network is no proof: there is a better one (TIMESYNC).
  net::SenderRule rule_{net::random_key(),
                        net::TrustedNetworks({}, [] { return std::vector<net::Network>(); })};
  std::array<std::byte, 4096> buffer_{};
};

/// Opens a serial line at that rate, 8N1, without any translation. @return its descriptor
[[nodiscard]] Expected<int> open_serial_port(const std::string& device, int baud);

}  // namespace fiducap
