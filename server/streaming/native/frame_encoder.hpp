#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/native/profile.hpp"

namespace fiducap::native {

/// A scene frame as Frame datagrams of at most kMaxDatagram bytes, encoded once for all clients of
/// one profile.
///
/// A body that is not valid is sent with its state and age and without a pose; so is one whose
/// numbers are not finite. Keeps its memory: after warm-up `encode` allocates nothing. Not
/// thread-safe.
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
