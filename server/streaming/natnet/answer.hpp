#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/natnet/bitstream.hpp"

/// Answers, struct → bytes. Frames have an encoder of their own.
namespace fiducap::natnet {

using Datagram = std::vector<std::byte>;

struct ServerInfo {
  std::array<std::uint8_t, 4>
      application_version{};  ///< Not all 0: a client takes that for no answer.
  Bitstream bitstream;        ///< What this client is sent.
  std::uint16_t data_port{};  ///< Where multicast frames go.
  bool is_multicast{};
  std::array<std::uint8_t, 4> group{};  ///< First octet first; also for unicast.
};

[[nodiscard]] Datagram encode(const ServerInfo& info);
/// @param received_at  when the request came, on the clock of the frames' ticks
[[nodiscard]] Datagram encode_echo(std::uint64_t client_ticks, Instant received_at);
[[nodiscard]] Datagram encode_response(std::int32_t value);
[[nodiscard]] Datagram encode_response(float value);
/// With a NUL, cut to kMaxText.
[[nodiscard]] Datagram encode_text_response(std::string_view text);
/// `Bitstream,3.1.0` without a NUL: a client turns the last field into a number as it stands.
[[nodiscard]] Datagram encode_bitstream_response(Bitstream version);
[[nodiscard]] Datagram encode_unrecognized();

/// The bodies of a scene as clients are told of them: at most kMaxBodies, names fit, distinct, and
/// together short enough that the definitions fit one datagram in every layout.
[[nodiscard]] std::vector<BodyDescription> announced_bodies(const SceneModel& model,
                                                            const NameRule& rule,
                                                            const NameAliases& aliases = {});

/// MODELDEF. Bodies are rigid bodies without parent, offset or markers: clients add the offset to
/// every pose.
/// @param types  bit n: descriptions of type n are wanted; we have type 1 only
/// @pre bodies come from announced_bodies
[[nodiscard]] std::vector<std::byte> encode_model(std::span<const BodyDescription> bodies,
                                                  ModelLayout layout, std::uint32_t types = ~0U);

}  // namespace fiducap::natnet
