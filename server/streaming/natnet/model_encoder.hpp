#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/natnet/bitstream.hpp"

namespace fiducap::natnet {

/// The bodies of a scene as clients are told of them: at most kMaxBodies, names fit, distinct, and together short
/// enough that the definitions fit one datagram in every layout.
[[nodiscard]] std::vector<BodyDescription> announced_bodies(const SceneModel& model, const NameRule& rule,
                                                            const NameAliases& aliases = {});

/// MODELDEF. Bodies are rigid bodies without parent, offset or markers: clients add the offset to every pose.
/// @param types  bit n: descriptions of type n are wanted; we have type 1 only
/// @pre bodies come from announced_bodies
[[nodiscard]] std::vector<std::byte> encode_model(std::span<const BodyDescription> bodies, ModelLayout layout,
                                                  std::uint32_t types = ~0U);

}  // namespace fiducap::natnet
