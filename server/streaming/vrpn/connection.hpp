#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/expected.hpp"
#include "base/log.hpp"
#include "streaming/vrpn/codec.hpp"
#include "streaming/vrpn/sender_table.hpp"
#include "streaming/vrpn/vrpn_config.hpp"

namespace fiducap::vrpn {

/// How a connection came about; decides whether UDP may be used.
enum class Origin {
  kDirect,     ///< The client connected to our port: everything by TCP.
  kRequested,  ///< The client asked by datagram and we connected to it: reports by UDP once it
               ///< names a port.
};

/// Something worth a log line.
struct Note {
  log::Level level{};
  std::string text;
};

/// One client's conversation: bytes in, bytes out, no socket. The time is passed in.
///
/// Keeps the client's own numbering of senders and types (unrelated to ours). Its names stay here:
/// nothing a client mentions ever reaches another client. Answers pings for bodies and the three
/// requests; everything else is ignored.
class Connection final {
 public:
  /// @param senders  outlives the connection; may grow, see describe_new_senders.
  Connection(const VrpnConfig& config, const SenderTable& senders, Origin origin);

  /// What the server says first, without waiting for the client.
  [[nodiscard]] std::vector<std::byte> greeting() const;

  /// Takes bytes cut anywhere. Answers are appended to `out`, whole messages, sequence numbers 0.
  /// @return Error when the conversation is over: wrong version or broken framing.
  Expected<void> receive(std::span<const std::byte> bytes, std::int64_t utc_ns,
                         std::vector<std::byte>& out);

  /// Describes bodies that appeared since the last call; nothing before the client's cookie came.
  void describe_new_senders(std::int64_t utc_ns, std::vector<std::byte>& out);

  [[nodiscard]] bool open() const { return cookie_.has_value(); }
  /// Where the client wants its reports; nothing: by TCP.
  [[nodiscard]] std::optional<std::uint16_t> udp_port() const { return udp_port_; }
  /// Since the last call; a client can cause only a few in its life.
  [[nodiscard]] std::vector<Note> take_notes();

 private:
  void greet_back(std::int64_t utc_ns, std::vector<std::byte>& out);
  void handle(const Message& message, std::int64_t utc_ns, std::vector<std::byte>& out);
  void learn_sender(const Message& message);
  void learn_type(const Message& message);
  void learn_udp_port(const Message& message);
  void answer(Type type, const Message& message, std::int64_t utc_ns, std::vector<std::byte>& out);
  void explain_unknown_body(const std::string& name, std::int64_t utc_ns,
                            std::vector<std::byte>& out);
  [[nodiscard]] std::string list_for_people() const;
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
  std::unordered_map<std::int32_t, Type> peer_types_;           ///< Only those we know.
  std::vector<std::string> explained_;  ///< Unknown bodies already explained.
  std::vector<Note> notes_;
  int notes_left_{16};
};

}  // namespace fiducap::vrpn
