#pragma once

#include <functional>
#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "middleware/participant.hpp"
#include "streaming/dds/dds_config.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::dds {

using JoinDomain = std::function<Expected<std::shared_ptr<Participant>>()>;

/// ROS 2 topics and the native keyed types on DDS. A topic nobody listens to costs nothing but its
/// place in discovery.
///
/// The middleware has threads of its own for discovery and repeats; every write happens on the I/O
/// thread, once per topic, however many listen.
/// A crowded domain (Participant::is_crowded) is left, and joined again ten seconds later.
/// @param join  also called later
/// @param events  what `/diagnostics` tells; nullptr: nothing but the bodies
/// @return Error naming the topic that could not be made
[[nodiscard]] Expected<std::unique_ptr<Streamer>> start_dds_server(
    JoinDomain join, const DdsConfig& config, std::shared_ptr<const SceneModel> model,
    const Clock& clock, const EventBoard* events = nullptr);

/// For the list of protocols.
[[nodiscard]] inline Expected<std::unique_ptr<Streamer>> serve(const ProtocolContext& context,
                                                               const DdsConfig& config) {
  return start_dds_server(context.join_dds, config, context.model, context.clock, &context.events);
}

}  // namespace fiducap::dds
