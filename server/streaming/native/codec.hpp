#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/native/wire.hpp"

/// Control messages of the native protocol, struct ↔ bytes. Meaning of every field: `proto/fiducap/v1/`.
/// Frames have their own encoder, see frame_encoder.hpp.
namespace fiducap::native {

using Datagram = std::vector<std::byte>;

struct SubscribeRequest {
  std::uint64_t token{};
  std::uint64_t nonce{};
  std::uint64_t model_generation{};
  std::string client_name;
  std::uint64_t frames_lost{};
};
struct UnsubscribeRequest {
  std::uint64_t token{};
};
using Request = std::variant<SubscribeRequest, UnsubscribeRequest>;

/// @return Error for anything that is not a request a client may send, naming what was expected and what came.
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
};
enum class NoticeReason { kServerFull = 1, kAddressFull = 2, kShuttingDown = 3 };

[[nodiscard]] Datagram encode(const ChallengeAnswer& challenge);
[[nodiscard]] Datagram encode(const LeaseAnswer& lease);
[[nodiscard]] Datagram encode_notice(std::uint64_t session, std::uint64_t nonce, NoticeReason reason,
                                     std::string_view text);
/// The list of bodies in as many datagrams as it needs; at least one, even for an empty scene.
/// @pre model.bodies.size() <= kMaxBodies; longer names are cut at kMaxBodyName (between characters).
[[nodiscard]] std::vector<Datagram> encode_model(std::uint64_t session, const SceneModel& model);

}  // namespace fiducap::native
