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
#include "streaming/vicon/codec.hpp"
#include "streaming/vicon/profile.hpp"

namespace fiducap::vicon {

/// One client's conversation: bytes in, answers and wishes out, no socket. The time is passed in.
///
/// The server speaks first (greeting: all types it can send), the client answers with the types it
/// wants, then asks for frames: for all of them (push), for one (pull) or for the next n
/// (prefetch). A request that overtakes the types is remembered. Wishes never add up: a client that
/// asks five times for a frame gets one.
class Connection final {
 public:
  static constexpr Duration kSilence =
      std::chrono::seconds(10);  ///< Until the types, or the rest of a packet, are here.

  /// @param profiles  outlives the connection
  Connection(ProfileTable& profiles, Instant now) : profiles_(profiles), waiting_since_(now) {}

  /// What the server says first; nothing else may go before it.
  [[nodiscard]] std::vector<std::byte> greeting();

  /// Takes bytes cut anywhere. Answers (of pings) are appended to `out`, whole packets.
  /// @return Error when the conversation is over: broken framing
  Expected<void> receive(std::span<const std::byte> bytes, Instant now,
                         std::vector<std::byte>& out);

  /// Is the frame `id` wanted now? A client never gets the same frame twice.
  [[nodiscard]] bool wants(std::uint32_t id) const;
  /// Must the next frame carry the static objects? @param version  theirs, as of now
  [[nodiscard]] bool wants_statics(std::uint64_t version) const { return statics_sent_ != version; }
  /// The frame is on its way.
  void sent(std::uint32_t id, std::optional<std::uint64_t> statics_version);

  /// Has said which types it wants.
  [[nodiscard]] bool open() const { return profile_ != nullptr; }
  /// @pre open()
  [[nodiscard]] const std::shared_ptr<const Profile>& profile() const { return profile_; }
  /// @return why this client must be closed
  [[nodiscard]] std::optional<std::string> overdue(Instant now) const;
  /// For people: `push, segments, 2 subjects`.
  [[nodiscard]] std::string summary() const;

 private:
  Expected<void> take_packet(std::span<const std::byte> objects, std::vector<std::byte>& out);
  Expected<void> take(const Object& object, std::vector<std::byte>& out);
  void take_types(TypeSet types);
  void take_filter(SubjectFilter filter);
  void use(Profile wanted);
  void ask(bool streaming);

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
  std::optional<std::uint64_t> statics_sent_;  ///< Version; nothing: none, or none for these types.
  std::optional<Instant> waiting_since_;       ///< For types, or for the rest of a packet.
};

}  // namespace fiducap::vicon
