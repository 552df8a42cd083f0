#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/imu/link_config.hpp"
#include "capture/sensor_source.hpp"
#include "middleware/net/networks.hpp"

namespace fiducap {

/// `192.168.1.20` or `192.168.1.20:14580`; without a port it is 0. nullopt: neither.
[[nodiscard]] std::optional<net::Peer> parse_link_peer(const std::string& text);

/// A serial line, for this process alone, or a UDP socket.
///
/// Opening a serial line raises DTR, which restarts boards with auto-reset; closing leaves it
/// raised, so that opening again does not. Bytes received before the opening are discarded.
class ByteLink final {
 public:
  /// @return Error with device or port, and remedy
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
    net::Peer from{};                  ///< All zero: a serial line.
  };
  /// Waits for bytes; those of other senders are ignored. @return Error kClosed: disconnected line
  [[nodiscard]] Expected<Piece> read(Duration timeout);
  /// Never waits; bytes that the line does not accept are lost. Over UDP an address gets at most
  /// three times the bytes of IP that came in its name, unless it is the configured peer or proven.
  /// @param to  ignored by a serial line   @param proven  has answered a secret sent to its address
  void write(std::span<const std::byte> bytes, const net::Peer& to, bool proven = false);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool is_serial() const { return is_serial_; }
  /// UDP: the port that it listens on.
  [[nodiscard]] std::uint16_t port() const {
    net::SocketAddress address;
    socklen_t length = address.size();
    if (is_serial_ || ::getsockname(descriptor_, address.data(), &length) != 0) return 0;
    return address.peer().port;
  }

 private:
  ByteLink(int descriptor, std::string name, bool is_serial, std::optional<net::Peer> peer)
      : descriptor_(descriptor), name_(std::move(name)), is_serial_(is_serial), peer_(peer) {}
  [[nodiscard]] bool is_configured(const net::Peer& peer) const {
    return peer_ && peer_->same_address(peer) && (peer_->port == 0 || peer_->port == peer.port);
  }

  int descriptor_;
  std::string name_;
  bool is_serial_;
  std::optional<net::Peer> peer_;  ///< The only accepted sender; port 0: any of its ports.
  // An attached network is no proof: there is a better one (TIMESYNC).
  net::SenderRule rule_{net::random_key(),
                        net::TrustedNetworks({}, [] { return std::vector<net::Network>(); })};
  std::array<std::byte, 4096> buffer_{};
};

/// Opens a serial line at that rate, 8N1, without any translation. @return its descriptor
[[nodiscard]] Expected<int> open_serial_port(const std::string& device, int baud);

/// Checks whether the bytes of a link are the configured protocol, and reports the likely cause
/// once: nothing is connected, the baud rate is wrong, another protocol, a disturbed line.
class LinkWatch final {
 public:
  /// @param unit  of the protocol: `line of the IMU protocol`, `MAVLink frame`
  LinkWatch(std::string unit, bool is_serial, int baud)
      : unit_(std::move(unit)), is_serial_(is_serial), baud_(baud) {}

  /// Received bytes, possibly none, and their content. @param broken  units with a wrong checksum
  /// @return a message when a fault begins, or silence ends; else empty
  [[nodiscard]] std::string add(std::size_t bytes, std::size_t printable, std::uint64_t units,
                                std::uint64_t broken, Instant now);

 private:
  [[nodiscard]] std::string foreign_text() const;

  std::string unit_;
  bool is_serial_;
  int baud_;
  std::optional<Instant> received_at_;  ///< Newest byte, or the beginning.
  std::size_t bytes_{0};                ///< Since the last unit.
  std::size_t printable_{0};
  std::uint64_t broken_{0};
  std::uint64_t units_{0};  ///< Of the present window, for the share of broken ones.
  std::uint64_t broken_in_window_{0};
  bool is_silent_{false};
  bool is_foreign_{false};
  bool is_disturbed_{false};
};

[[nodiscard]] bool is_printable(std::byte byte);

/// A source of IMU samples that come over a ByteLink. Never ends; lost with its link.
class ByteSource : public SensorSource {
 public:
  Expected<std::optional<SensorSample>> next(std::stop_token stop) final;

 protected:
  struct Units {
    std::uint64_t good{0};
    std::uint64_t broken{0};
  };
  /// @param period  longest time between two calls of `finish`, and delay of a stop
  ByteSource(ByteLink link, std::string unit, int baud, Duration period, const Clock& clock)
      : link_(std::move(link)),
        watch_(std::move(unit), link_.is_serial(), baud),
        period_(period),
        clock_(clock) {}

  /// The oldest sample that was not taken yet.
  [[nodiscard]] virtual std::optional<ImuSample> take_sample() = 0;
  /// @param piece  possibly empty   @return its content; nullopt: ignored
  [[nodiscard]] virtual std::optional<Units> receive(const ByteLink::Piece& piece, Instant now) = 0;
  /// Called after each piece.
  virtual void finish(Instant now) = 0;
  [[nodiscard]] ByteLink& link() { return link_; }

 private:
  ByteLink link_;
  LinkWatch watch_;
  Duration period_;
  const Clock& clock_;
};

}  // namespace fiducap
