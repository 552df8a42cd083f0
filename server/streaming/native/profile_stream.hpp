#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "streaming/native/codec.hpp"
#include "streaming/native/frame_encoder.hpp"
#include "streaming/native/profile.hpp"

namespace fiducap::native {

/// What all clients of one profile get: the list of its bodies and its frames, each encoded once.
class ProfileStream final {
 public:
  ProfileStream(std::uint64_t session, GrantedProfile granted, const SceneModel& model);

  [[nodiscard]] std::uint32_t number() const { return granted_.number; }
  [[nodiscard]] const Profile& profile() const { return granted_.profile; }
  void use(const SceneModel& model);
  [[nodiscard]] std::span<const Datagram> model() const { return model_datagrams_; }
  /// @return nothing when this profile leaves the frame out; valid until the next call
  [[nodiscard]] std::span<const std::span<const std::byte>> encode(const SceneFrame& frame);

 private:
  std::uint64_t session_;
  GrantedProfile granted_;
  FrameEncoder encoder_;
  std::vector<std::uint32_t> chosen_;
  std::vector<Datagram> model_datagrams_;
};

}  // namespace fiducap::native
