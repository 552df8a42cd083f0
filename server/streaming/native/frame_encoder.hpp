#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "scene/scene_frame.hpp"

namespace fiducap::native {

/// A scene frame as Frame datagrams of at most kMaxDatagram bytes, encoded once for all clients.
///
/// A body that is not valid is sent with its state and age and without a pose; so is one whose numbers are not
/// finite. Keeps its memory: after warm-up `encode` allocates nothing. Not thread-safe.
class FrameEncoder final {
 public:
  explicit FrameEncoder(std::uint64_t session);
  ~FrameEncoder();

  /// @pre frame.bodies.size() <= kMaxBodies, frame.model is set
  /// @return at least one datagram, also for an empty scene; valid until the next call
  [[nodiscard]] std::span<const std::span<const std::byte>> encode(const SceneFrame& frame);

 private:
  class Messages;  // protobuf stays in the source file

  std::uint64_t session_;
  std::unique_ptr<Messages> messages_;
  std::vector<std::byte> bytes_;
  std::vector<std::span<const std::byte>> datagrams_;
};

}  // namespace fiducap::native
