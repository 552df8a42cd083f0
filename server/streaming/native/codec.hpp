#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/native/frames.hpp"

/// Datagrams of the native protocol except frames (frames.hpp), struct ↔ bytes. Meaning of every
/// field: `proto/fiducap/v1/`.
namespace fiducap::native {

using Datagram = std::vector<std::byte>;

struct SubscribeRequest {
  std::uint64_t token{};
  std::uint64_t nonce{};
  std::uint64_t model_generation{};
  std::string client_name;
  std::uint64_t frames_lost{};
  std::optional<Profile> profile;  ///< nullopt: one with unknown values.
  bool multicast{};
  Duration clock_offset{};  ///< Server's minus client's.
  Duration clock_sigma{};   ///< 0: not measured.
  Duration latency_p99{};   ///< 0: unknown.
};
struct UnsubscribeRequest {
  std::uint64_t token{};
};
struct ClockRequest {
  std::uint64_t token{};
  std::uint64_t number{};
};
struct DiscoveryRequest {
  std::uint64_t nonce{};
};
using Request = std::variant<SubscribeRequest, UnsubscribeRequest, ClockRequest, DiscoveryRequest>;

/// @return Error with what was expected and what came, for anything but a request of a client
[[nodiscard]] Expected<Request> decode_request(std::span<const std::byte> datagram);

struct ChallengeAnswer {
  std::uint64_t token{};
  std::uint64_t nonce{};
  std::uint64_t session{};
};
struct LeaseAnswer {
  std::uint64_t session{};
  std::uint64_t nonce{};
  std::uint64_t token{};
  Duration lease{};
  std::uint64_t model_generation{};
  std::uint32_t profile{};
  std::array<std::uint8_t, 4> group{};  ///< IPv4 multicast group of the frames.
  std::uint16_t group_port{};           ///< 0: unicast.
  std::uint64_t frames_dropped{};
};
enum class NoticeReason {
  kServerFull = 1,
  kAddressFull = 2,
  kShuttingDown = 3,
  kProfilesFull = 4,
  kProfileInvalid = 5
};
struct ClockAnswer {
  std::uint64_t session{};
  std::uint64_t number{};
  Instant received_at{};
  Instant sent_at{};
};
/// Reply to discovery.
struct ServerCard {
  std::string host;     ///< Cut at 64 bytes.
  std::string version;  ///< Cut at 32 bytes.
  std::uint32_t body_count{};
  double rate_hz{};
  std::uint16_t port{};
};

[[nodiscard]] Datagram encode(const ChallengeAnswer& challenge);
[[nodiscard]] Datagram encode(const LeaseAnswer& lease);
[[nodiscard]] Datagram encode(const ClockAnswer& answer);
[[nodiscard]] Datagram encode_discovery(std::uint64_t nonce, std::uint64_t session,
                                        const ServerCard& card);
[[nodiscard]] Datagram encode_notice(std::uint64_t session, std::uint64_t nonce,
                                     NoticeReason reason, std::string_view text);
/// The list of bodies in one or more datagrams. Names are cut at kMaxBodyName, between characters.
/// @pre model.bodies.size() <= kMaxBodies
[[nodiscard]] std::vector<Datagram> encode_model(std::uint64_t session, const SceneModel& model,
                                                 std::uint32_t profile = 0);

}  // namespace fiducap::native
