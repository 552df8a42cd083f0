#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/log.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/net/tcp_session.hpp"
#include "streaming/net/udp_server.hpp"
#include "streaming/streamer.hpp"
#include "streaming/vrpn/codec.hpp"
#include "streaming/vrpn/vrpn.hpp"

namespace fiducap::vrpn {

/// @return every broken rule for a body's name in VRPN: 1 to 95 bytes, no `@` (separates name and
/// host), no control bytes, not `VRPN Control`; empty when usable.
/// @param path  of the name in the configuration, e.g. `bodies[2].name`
[[nodiscard]] std::vector<ConfigError> check_body_name(const std::string& path,
                                                       std::string_view name);

/// Sender ids by name, for the life of the server. Sender 0 is `VRPN Control`, bodies follow
/// without holes. An id is never reused: VRPN cannot remove a sender.
class SenderTable final {
 public:
  static constexpr std::int32_t kNone = -1;

  explicit SenderTable(NameAliases aliases = {});

  /// Adds the bodies of a new generation; the same generation again does nothing.
  /// @return names that cannot be served (rule broken, doubled, ids used up)
  std::vector<std::string> update(const SceneModel& model);

  /// All names ever described, by id.
  [[nodiscard]] std::span<const std::string> names() const { return names_; }
  /// Sender id per body, in the order of the model; kNone for one that cannot be served.
  [[nodiscard]] std::span<const std::int32_t> of_bodies() const { return of_bodies_; }
  /// @return the id of a body of the current generation.
  [[nodiscard]] std::optional<std::int32_t> find_body(std::string_view name) const;
  /// Configured name of a sender's body. @pre of_bodies() has the id
  [[nodiscard]] const std::string& own_name_of(std::int32_t id) const;
  /// `a, b, c`
  [[nodiscard]] std::string list_bodies() const;

 private:
  [[nodiscard]] std::int32_t id_for(const std::string& name);

  NameAliases aliases_;
  std::optional<std::uint64_t> generation_;
  std::vector<std::string> names_;
  std::vector<std::int32_t> of_bodies_;
  std::vector<std::string> own_names_;  ///< As of_bodies_.
};

/// Reports a lost or recovered body as a text message from that body, because poses simply stop.
/// Lost is a warning (clients print it), recovered is not. At most one message per second and body,
/// with the latest state.
class BodyWatch final {
 public:
  /// @param sender_of_body  in the order of frame.bodies; negative: not served.
  /// @param out  whole messages are appended, rarely any.
  void observe(const SceneFrame& frame, std::span<const std::int32_t> sender_of_body,
               std::vector<std::byte>& out);

 private:
  struct Seen {
    bool ever{false};           ///< Valid once; a body that was never seen is not lost.
    bool reported_valid{true};  ///< Last report.
    std::optional<Instant> reported_at;
  };
  std::vector<Seen> by_sender_;
};

/// How a connection was established; decides whether UDP may be used.
enum class Origin {
  kDirect,     ///< By the client: everything by TCP.
  kRequested,  ///< By us, after its datagram: reports by UDP once it names a port.
};

/// A line for the log.
struct Note {
  log::Level level{};
  std::string text;
};

/// One client's protocol state: bytes in, bytes out, no socket. The time is passed in.
///
/// Keeps the client's numbering of senders and types (unrelated to ours); no data of a client
/// reaches another one. Answers pings for bodies and three requests; ignores everything else.
class Connection final {
 public:
  /// @param senders  outlives the connection; may grow
  Connection(const VrpnConfig& config, const SenderTable& senders, Origin origin);

  /// The server's first bytes; does not wait for the client.
  [[nodiscard]] std::vector<std::byte> greeting() const;

  /// Takes bytes cut anywhere. Appends replies to `out`: whole messages, sequence numbers 0.
  /// @return Error that ends the session: wrong version or broken framing
  Expected<void> receive(std::span<const std::byte> bytes, std::int64_t utc_ns,
                         std::vector<std::byte>& out);

  /// Describes bodies that are new since the last call; nothing before the client's cookie.
  void describe_new_senders(std::int64_t utc_ns, std::vector<std::byte>& out);

  [[nodiscard]] bool open() const { return cookie_.has_value(); }
  /// For reports; nullopt: by TCP.
  [[nodiscard]] std::optional<std::uint16_t> udp_port() const { return udp_port_; }
  /// Since the last call; a client can cause only a few in total.
  [[nodiscard]] std::vector<Note> take_notes();

 private:
  void handle(const Message& message, std::int64_t utc_ns, std::vector<std::byte>& out);
  void learn_sender(const Message& message);
  void learn_type(const Message& message);
  void learn_udp_port(const Message& message);
  void answer(Type type, const Message& message, std::int64_t utc_ns, std::vector<std::byte>& out);
  void explain_unknown_body(const std::string& name, std::int64_t utc_ns,
                            std::vector<std::byte>& out);
  [[nodiscard]] std::string body_list() const;
  void note(log::Level level, std::string text);

  const VrpnConfig& config_;
  const SenderTable& senders_;
  const Origin origin_;
  Eigen::Vector3d box_low_;  ///< Workspace in the client's axes.
  Eigen::Vector3d box_high_;
  std::vector<std::byte> in_;
  std::optional<Cookie> cookie_;
  std::optional<std::uint16_t> udp_port_;
  std::size_t described_{0};
  std::unordered_map<std::int32_t, std::string> peer_senders_;  ///< By the client's id.
  std::unordered_map<std::int32_t, Type> peer_types_;           ///< Only known ones.
  std::vector<std::string> explained_;  ///< Unknown bodies already explained.
  std::vector<Note> notes_;
  int notes_left_{16};
};

/// Shared by the sessions of one server; lives as long as their handlers.
struct SessionContext {
  VrpnConfig config;
  const Clock& clock;
  SenderTable senders{config.aliases};
  Duration utc_offset{};  ///< Of the newest frame; zero before the first.
  /// Of the next message; one count for all clients, which only look for gaps in a log.
  std::uint32_t sequence{0};

  [[nodiscard]] std::int64_t utc_ns(Instant now) const { return to_ns(now) + utc_offset.count(); }
};

/// One client's TCP socket and protocol state. The server sends reports that go by UDP.
class Session final : public net::TcpSession {
 public:
  static constexpr Duration kCookieTime = std::chrono::seconds(5);

  Session(std::shared_ptr<SessionContext> context, net::Socket socket, Origin origin);

  /// Sends the cookie at once: some clients wait for it.
  void start() override;
  void describe_new_senders();
  /// Whole messages, numbered, by TCP.
  using TcpSession::send;

  [[nodiscard]] bool open() const { return !closed() && connection_.open(); }
  [[nodiscard]] Origin origin() const { return origin_; }
  [[nodiscard]] std::optional<std::uint16_t> udp_port() const { return connection_.udp_port(); }
  [[nodiscard]] ClientStatus status(Instant now) const;

  net::DatagramShare datagrams;

 private:
  void received(std::span<const std::byte> bytes) override;
  void ticked(Instant now) override;
  [[nodiscard]] std::string transport_text() const;

  std::shared_ptr<SessionContext> context_;
  Origin origin_;
  Connection connection_;
  std::optional<Instant> open_since_;
};

}  // namespace fiducap::vrpn
