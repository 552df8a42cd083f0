#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/qualisys/body_table.hpp"
#include "streaming/qualisys/codec.hpp"
#include "streaming/qualisys/command.hpp"
#include "streaming/qualisys/control.hpp"
#include "streaming/qualisys/frame_board.hpp"
#include "streaming/qualisys/qualisys_config.hpp"

namespace fiducap::qualisys {

/// What all connections of one server know.
struct SharedState {
  SharedState(const QualisysConfig& c, OperatorDesk* desk)
      : config(c), control(desk), bodies(c.aliases), frames(c) {}

  const QualisysConfig config;
  Control control;
  BodyTable bodies;
  FrameBoard frames;
  double rate_hz{0};  ///< Of the frames; 0 before the first.
  Instant now{};      ///< Of the server's last tick: good enough for who guesses passwords.
  net::WrongProofs wrong_passwords;
  const std::array<std::uint64_t, 2> key{net::random_key()};
};

/// Which port the client came to.
enum class Dialect { kLegacy, kLittleEndian, kBigEndian };

/// Chooses the frames of one client's stream: all, every n-th, or about n per second.
class FramePicker final {
 public:
  explicit FramePicker(Rate rate) : rate_(rate) {}

  /// Ask once per frame.
  [[nodiscard]] bool wants(const SceneFrame& frame);

 private:
  Rate rate_;
  std::optional<std::uint64_t> first_;
  std::optional<Instant> due_;
};

/// One client's conversation: bytes in, bytes out, no socket. Keeps what it streams.
class Connection final {
 public:
  /// @param shared  outlives the connection
  /// @param address, port  of the client; UDP goes to no other address
  Connection(SharedState& shared, Dialect dialect, std::uint64_t id, std::string address,
             std::uint16_t port);

  /// What the server says first.
  void greet(std::vector<std::byte>& out) const;
  /// Takes bytes cut anywhere; answers are appended to `out`.
  /// @return Error when the conversation is over: broken framing, or more questions than it reads
  ///         answers to.
  Expected<void> receive(std::span<const std::byte> bytes, std::vector<std::byte>& out);
  void tell(Event event, std::vector<std::byte>& out) const { encode_event(order_, event, out); }
  /// The client is gone.
  void leave() { shared_.control.left(id_); }

  /// The stream that was asked for, by TCP unless it names a port.
  [[nodiscard]] bool streaming() const { return stream_.has_value(); }
  [[nodiscard]] std::optional<std::uint16_t> udp_port() const;
  /// Does the stream take this frame? Ask once per frame.
  [[nodiscard]] std::optional<Profile> stream_of(const SceneFrame& frame);
  /// A GetCurrentFrame that this frame answers; one frame answers one.
  [[nodiscard]] std::optional<Profile> current_of(std::uint64_t frame_number);

  [[nodiscard]] bool spoke() const { return spoke_; }
  [[nodiscard]] std::string detail() const;

 private:
  struct Stream {
    StreamRequest request;
    FramePicker picker;
  };
  void handle(const Packet& packet, std::vector<std::byte>& out);
  void obey(const Command& command, std::vector<std::byte>& out);
  void set_version(std::string_view word, std::vector<std::byte>& out);
  void stream_frames(std::string_view words, std::vector<std::byte>& out);
  void current_frame(std::string_view words, std::vector<std::byte>& out);
  void parameters(std::string_view words, std::vector<std::byte>& out);
  void byte_order(std::string_view words, std::vector<std::byte>& out);
  void take_control(std::string_view password, std::vector<std::byte>& out);
  void reply(const Reply& reply, std::vector<std::byte>& out) const;
  [[nodiscard]] Profile profile_of(Components components) const;
  [[nodiscard]] std::uint64_t address_hash() const;

  SharedState& shared_;
  const Dialect dialect_;
  const std::endian order_;
  const std::uint64_t id_;
  const std::string address_;
  const std::uint16_t port_;
  Version version_;
  bool spoke_{false};
  int wrong_passwords_{0};
  std::vector<std::byte> in_;
  std::optional<Stream> stream_;
  std::deque<Components> pending_;  ///< Of GetCurrentFrame.
  std::uint64_t answered_frame_{0};
};

}  // namespace fiducap::qualisys
