#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/time.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/native/frames.hpp"

/// Datagrams of the native protocol except frames (frames.hpp), struct ↔ bytes. Meaning of every
/// field: `proto/fiducap/v1/`.
namespace fiducap::native {

using Datagram = std::vector<std::byte>;

/// What a client measures.
struct ClientReport {
  std::uint64_t frames_lost{};  ///< On the way.
  Duration clock_offset{};      ///< Server's minus client's.
  Duration clock_sigma{};       ///< 0: not measured.
  Duration latency_p99{};       ///< 0: unknown.
};
struct SubscribeRequest {
  std::uint64_t token{};
  std::uint64_t nonce{};
  std::uint64_t model_generation{};
  std::string client_name;
  std::optional<Profile> profile;  ///< nullopt: one with unknown values.
  bool multicast{};
  ClientReport report;
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

/// @return nullopt for anything but a request of a client, and for one that is not padded
[[nodiscard]] std::optional<Request> decode_request(std::span<const std::byte> datagram);

/// For clients that request multicast. Port 0: no group.
struct MulticastGroup {
  std::array<std::uint8_t, 4> address{};  ///< IPv4.
  std::uint16_t port{};
};
struct LeaseAnswer {
  std::uint64_t session{};
  std::uint64_t nonce{};
  std::uint64_t token{};
  Duration lease{};
  std::uint64_t model_generation{};
  std::uint32_t profile{};
  MulticastGroup group{};  ///< Of the frames; none: unicast.
  std::uint64_t frames_dropped{};
};
enum class NoticeReason {
  kServerFull = 1,
  kAddressFull = 2,
  kShuttingDown = 3,
  kProfilesFull = 4,
  kProfileInvalid = 5
};
/// Reply to discovery.
struct ServerCard {
  std::string host;     ///< Cut at 64 bytes.
  std::string version;  ///< Cut at 32 bytes.
  std::uint32_t body_count{};
  double rate_hz{};
  std::uint16_t port{};
};

[[nodiscard]] Datagram encode_challenge(std::uint64_t token, std::uint64_t nonce,
                                        std::uint64_t session);
[[nodiscard]] Datagram encode(const LeaseAnswer& lease);
/// @param at  when the request was received and this is sent
[[nodiscard]] Datagram encode_clock(std::uint64_t session, std::uint64_t number, Instant at);
[[nodiscard]] Datagram encode_discovery(std::uint64_t nonce, std::uint64_t session,
                                        const ServerCard& card);
[[nodiscard]] Datagram encode_notice(std::uint64_t session, std::uint64_t nonce,
                                     NoticeReason reason, std::string_view text);
/// The list of bodies in one or more datagrams. Names are cut at kMaxBodyName, between characters.
/// @pre model.bodies.size() <= kMaxBodies
[[nodiscard]] std::vector<Datagram> encode_model(std::uint64_t session, const SceneModel& model,
                                                 std::uint32_t profile = 0);

}  // namespace fiducap::native
