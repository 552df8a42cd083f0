#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "streaming/net/tcp_session.hpp"
#include "streaming/streamer.hpp"
#include "streaming/vicon/codec.hpp"
#include "streaming/vicon/frame_board.hpp"
#include "streaming/vicon/protocol.hpp"
#include "streaming/vicon/vicon.hpp"

namespace fiducap::vicon {

/// One client's protocol state: bytes in, replies and requests out, no socket; time is passed in.
///
/// The server sends its greeting (all its types), the client replies with the types it wants, then
/// requests all frames (push), one (pull) or the next n (prefetch). A request before the types is
/// remembered. Requests do not add up: five requests for a frame get one.
class Connection final {
 public:
  /// Limit for the types, and for the rest of a packet.
  static constexpr Duration kSilence = std::chrono::seconds(10);

  /// @param profiles  outlives the connection
  Connection(ProfileTable& profiles, Instant now) : profiles_(profiles), waiting_since_(now) {}

  /// The server's first bytes.
  [[nodiscard]] std::vector<std::byte> greeting();

  /// Takes bytes cut anywhere. Appends replies (of pings) to `out`, whole packets.
  /// @return Error that ends the session: broken framing
  Expected<void> receive(std::span<const std::byte> bytes, Instant now,
                         std::vector<std::byte>& out);

  /// @return the frame `id` is to be sent now; each frame is sent once
  [[nodiscard]] bool wants(std::uint32_t id) const;
  /// @return the next frame must have the static objects   @param version  theirs
  [[nodiscard]] bool wants_statics(std::uint64_t version) const { return statics_sent_ != version; }
  /// The frame was offered to the client.
  void sent(std::uint32_t id, std::optional<std::uint64_t> statics_version);

  /// The client has sent its types.
  [[nodiscard]] bool open() const { return profile_ != nullptr; }
  /// @pre open()
  [[nodiscard]] const std::shared_ptr<const Profile>& profile() const { return profile_; }
  /// @return why this client must be closed
  [[nodiscard]] std::optional<std::string> overdue(Instant now) const;
  /// For the page: `push, segments, 2 subjects`.
  [[nodiscard]] std::string summary() const;

 private:
  Expected<void> take_packet(std::span<const std::byte> objects, std::vector<std::byte>& out);
  Expected<void> take(const Object& object, std::vector<std::byte>& out);
  void use(Profile wanted);

  ProfileTable& profiles_;
  std::vector<std::byte> in_;
  bool greeted_{false};
  std::shared_ptr<const Profile> profile_;
  SubjectFilter early_filter_;  ///< Came before the types.
  bool streaming_{false};
  bool pull_{false};
  std::uint32_t next_{0};
  enum class Mode { kSilent, kPull, kPrefetch, kPush } mode_{Mode::kSilent};
  std::optional<std::uint32_t> last_sent_;
  std::optional<std::uint64_t> statics_sent_;  ///< Version; nullopt: none for these types.
  std::optional<Instant> waiting_since_;       ///< For types, or for the rest of a packet.
};

/// Shared by the sessions of one server; lives as long as their handlers.
struct SessionContext {
  SessionContext(const ViconConfig& config, const Clock& time)
      : clock(time), board(config.when_invalid, config.aliases) {}

  const Clock& clock;
  FrameBoard board;
  ProfileTable profiles;
};

/// One client's socket and protocol state.
class Session final : public net::TcpSession {
 public:
  /// From accept to greeting. SDK 1.12 requests segments just after connecting; with a delayed
  /// greeting its first frame already has poses.
  static constexpr Duration kGreetingDelay = std::chrono::milliseconds(40);

  Session(net::Socket socket, std::shared_ptr<SessionContext> context);

  void start() override;
  /// Offers the newest frame if the client requested it.
  void publish();

  [[nodiscard]] bool open() const { return connection_.open(); }
  [[nodiscard]] ClientStatus status(Instant now) const;

 private:
  void received(std::span<const std::byte> bytes) override;
  void ticked(Instant now) override;
  void woken() override;

  std::shared_ptr<SessionContext> context_;
  Connection connection_;
  bool statics_in_last_frame_{false};
};

}  // namespace fiducap::vicon
