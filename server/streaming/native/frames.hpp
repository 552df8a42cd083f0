#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"

namespace fiducap::native {

/// First field of every datagram, see `proto/fiducap/v1/envelope.proto`: "FDC1".
inline constexpr std::uint32_t kProtocol = 0x31434446;
/// Fits every path between two hosts without fragments (IPv6 minimum MTU 1280 minus headers).
inline constexpr std::size_t kMaxDatagram = 1200;
/// A shorter Subscribe is ignored: the reply to an unproven address must not be longer.
inline constexpr std::size_t kMinSubscribe = 128;
inline constexpr std::size_t kMinClockQuery = 64;
inline constexpr std::size_t kMinDiscovery = 256;
inline constexpr std::size_t kMaxBodies = 1024;
inline constexpr std::size_t kMaxParts = 256;
inline constexpr std::size_t kMaxBodyName = 128;
inline constexpr std::size_t kMaxClientName = 64;
inline constexpr int kMaxChosenBodies = 32;
inline constexpr std::size_t kMaxHostName = 64;
inline constexpr std::size_t kMaxVersion = 32;

/// A client's selection; default: all bodies and frames in the server's axes and metres.
struct Profile {
  OutputAxes axes;
  float max_rate_hz{0};  ///< 0: every frame.
  bool covariance{true};
  std::vector<std::string> bodies;  ///< Names, sorted, each once; empty: all.

  bool operator==(const Profile&) const = default;
  [[nodiscard]] bool is_default() const { return *this == Profile{}; }
};

/// A profile with its number in frames, models and leases; 0 is the default profile.
struct GrantedProfile {
  std::uint32_t number{};
  Profile profile;
};

/// The profiles in use, at most kMost besides the default one.
class ProfileTable final {
 public:
  static constexpr std::size_t kMost = 16;

  /// @return its number; nullopt when the table is full
  [[nodiscard]] std::optional<std::uint32_t> grant(const Profile& profile) {
    if (profile.is_default()) return 0;
    for (const auto& known : profiles_)
      if (known.profile == profile) return known.number;
    if (profiles_.size() == kMost) return std::nullopt;
    profiles_.push_back({++last_number_, profile});
    return last_number_;
  }
  /// Removes unused profiles. @param is_used  of a number
  template <typename IsUsed>
  void prune(IsUsed&& is_used) {
    std::erase_if(profiles_, [&](const GrantedProfile& known) { return !is_used(known.number); });
  }
  /// Without the default one.
  [[nodiscard]] std::span<const GrantedProfile> profiles() const { return profiles_; }

 private:
  std::vector<GrantedProfile> profiles_;
  std::uint32_t last_number_{0};  ///< Numbers are never reused: old frames may still arrive.
};

/// The profile gets the frames whose numbers are multiples of this.
[[nodiscard]] std::uint64_t step_of(const Profile& profile, double rate_hz);
/// Places in model.bodies of the profile's bodies, in order.
[[nodiscard]] std::vector<std::uint32_t> chosen_bodies(const Profile& profile,
                                                       const SceneModel& model);
/// `y-up mm, at most 50 Hz, 2 bodies`
[[nodiscard]] std::string text_of(const Profile& profile);

/// Encodes frames as datagrams of at most kMaxDatagram bytes, once for all clients of a profile.
///
/// A body that is invalid or has non-finite numbers is sent without a pose. Keeps its memory: after
/// warm-up `encode` allocates nothing.
class FrameEncoder final {
 public:
  explicit FrameEncoder(std::uint64_t session, const GrantedProfile& profile = {});
  ~FrameEncoder();

  /// @param chosen  places in frame.bodies, in order
  /// @param step  see Frame.step
  /// @pre chosen.size() <= kMaxBodies, frame.model is set
  /// @return at least one datagram, also for an empty scene; valid until the next call
  [[nodiscard]] std::span<const std::span<const std::byte>> encode(
      const SceneFrame& frame, std::span<const std::uint32_t> chosen, std::uint64_t step = 1);
  /// All bodies.
  [[nodiscard]] std::span<const std::span<const std::byte>> encode(const SceneFrame& frame);

 private:
  class Messages;  // protobuf stays in the source file

  std::unique_ptr<Messages> messages_;
  std::vector<std::byte> bytes_;
  std::vector<std::span<const std::byte>> datagrams_;
  std::vector<std::uint32_t> all_;
};

}  // namespace fiducap::native
