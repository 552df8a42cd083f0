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
#include "streaming/net/tcp_session.hpp"
#include "streaming/net/udp_server.hpp"
#include "streaming/qualisys/codec.hpp"
#include "streaming/qualisys/control.hpp"
#include "streaming/qualisys/frame_board.hpp"
#include "streaming/qualisys/qualisys.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::qualisys {

/// Shared by all connections of one server.
struct SharedState {
  SharedState(const QualisysConfig& c, OperatorApi* operator_api)
      : config(c), control(operator_api), bodies(c.aliases), frames(c) {}

  const QualisysConfig config;
  Control control;
  BodyTable bodies;
  FrameBoard frames;
  double rate_hz{0};  ///< Of the frames; 0 before the first.
  Instant now{};      ///< Of the server's last tick, for wrong_passwords.
  net::WrongProofs wrong_passwords;
  const std::array<std::uint64_t, 2> key{net::random_key()};
};

/// Port of the client's connection.
enum class Dialect { kLegacy, kLittleEndian, kBigEndian };

/// Selects the frames of one client's stream: all, every n-th, or about n per second.
class FramePicker final {
 public:
  explicit FramePicker(Rate rate) : rate_(rate) {}

  /// Call once per frame.
  [[nodiscard]] bool wants(const SceneFrame& frame);

 private:
  Rate rate_;
  std::optional<std::uint64_t> first_;
  std::optional<Instant> due_;
};

/// One client's protocol state: bytes in, bytes out, no socket.
class Connection final {
 public:
  /// @param shared  outlives the connection
  /// @param address, port  of the client; UDP is sent to no other address
  Connection(SharedState& shared, Dialect dialect, std::uint64_t id, std::string address,
             std::uint16_t port);

  /// The server's first packet.
  void greet(std::vector<std::byte>& out) const;
  /// Takes bytes cut anywhere; appends replies to `out`.
  /// @return Error that ends the session: broken framing, too many unread replies, wrong passwords
  Expected<void> receive(std::span<const std::byte> bytes, std::vector<std::byte>& out);
  void append(Event event, std::vector<std::byte>& out) const { encode_event(order_, event, out); }
  void leave() { shared_.control.left(id_); }

  [[nodiscard]] bool streaming() const { return stream_.has_value(); }
  /// Of the stream; nullopt: by TCP.
  [[nodiscard]] std::optional<std::uint16_t> udp_port() const;
  /// @return nullopt: the stream skips this frame. Call once per frame
  [[nodiscard]] std::optional<Profile> stream_of(const SceneFrame& frame);
  /// A waiting GetCurrentFrame; one per frame.
  [[nodiscard]] std::optional<Profile> current_of(std::uint64_t frame_number);

  [[nodiscard]] bool has_spoken() const { return has_spoken_; }
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
  bool has_spoken_{false};
  int wrong_passwords_{0};
  std::vector<std::byte> in_;
  std::optional<Stream> stream_;
  std::deque<Components> pending_;  ///< Of GetCurrentFrame.
  std::uint64_t answered_frame_{0};
};

/// One client's TCP socket and protocol state. The server sends streams that go by UDP.
class Session final : public net::TcpSession {
 public:
  Session(net::Socket socket, std::shared_ptr<SharedState> shared, Dialect dialect,
          std::uint64_t id, const Clock& clock);

  [[nodiscard]] Connection& connection() { return connection_; }
  void start() override;
  void send_event(Event event);
  /// Sends the newest frame to one waiting GetCurrentFrame, if it is a new one.
  void answer_current();

  [[nodiscard]] ClientStatus status(Instant now) const;
  net::DatagramShare datagrams;

 private:
  void received(std::span<const std::byte> bytes) override;
  void ticked(Instant now) override;
  void ended() override { connection_.leave(); }

  std::shared_ptr<SharedState> shared_;
  Connection connection_;
};

}  // namespace fiducap::qualisys
