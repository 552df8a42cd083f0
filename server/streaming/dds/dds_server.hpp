#pragma once

#include <memory>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "middleware/participant.hpp"
#include "streaming/dds/dds_config.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::dds {

/// ROS 2 topics and the native keyed types on DDS. A topic nobody listens to costs nothing but its
/// place in discovery.
///
/// The middleware has threads of its own for discovery and repeats; every write happens on the I/O
/// thread, once per topic, however many listen.
/// @return Error naming the topic that could not be made
[[nodiscard]] Expected<std::unique_ptr<Streamer>> start_dds_server(
    std::shared_ptr<Participant> participant, const DdsConfig& config,
    std::shared_ptr<const SceneModel> model, const Clock& clock);

/// For the list of protocols.
[[nodiscard]] inline Expected<std::unique_ptr<Streamer>> serve(const ProtocolContext& context,
                                                               const DdsConfig& config) {
  auto participant = context.join_dds();
  if (!participant) return tl::unexpected(participant.error());
  return start_dds_server(*participant, config, context.model, context.clock);
}

}  // namespace fiducap::dds
