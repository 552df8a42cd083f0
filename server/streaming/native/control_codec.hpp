#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "streaming/operator_api.hpp"

/// Messages of the control channel, struct ↔ bytes. Meaning of every field:
/// `proto/fiducap/v1/control.proto`.
namespace fiducap::native {

inline constexpr std::size_t kMaxControlMessage = 65536;
inline constexpr std::size_t kChallengeSize = 32;

struct ControlRequest {
  std::uint64_t sequence{};
  std::string proof;
  std::string body;
  std::optional<std::uint64_t> watch_after{};  ///< Requests events after this number.
};

/// What a command does; empty: it only asks for the state.
using ControlAction = std::function<Expected<void>(OperatorApi&, const Requester& by)>;

[[nodiscard]] Expected<ControlRequest> decode_control_request(std::span<const std::byte> message);
/// @return Error `kUnsupported` for a command of a later version, `kInvalid` for invalid numbers
[[nodiscard]] Expected<ControlAction> decode_control_command(const std::string& body);

enum class ControlResult { kDone = 0, kRefused, kForbidden, kMalformed, kUnsupported, kBusy };

struct ControlState {
  std::vector<OperatorApi::Body> bodies;
  MapMode map_mode{};
  std::string recording;
  std::vector<RecordingStatus> recordings;
  std::int64_t map_version{};
};

struct ControlReply {
  std::uint64_t sequence{};
  ControlResult result{};
  std::string text;
  std::string challenge{};  ///< In the hello; else empty.
  std::optional<ControlState> state{};
};

/// With its length prepended.
void append(std::vector<std::byte>& out, const ControlReply& reply);

/// The part of a reply that is the same for all clients.
[[nodiscard]] std::string encode_events(std::span<const std::shared_ptr<const Event>> happened,
                                        std::span<const std::shared_ptr<const Event>> standing);
/// A reply with these events, with its length prepended.
void append(std::vector<std::byte>& out, std::uint64_t sequence, std::string_view encoded_events);

}  // namespace fiducap::native
