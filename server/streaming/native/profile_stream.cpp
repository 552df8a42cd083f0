#include "streaming/native/profile_stream.hpp"

#include <utility>

namespace fiducap::native {

ProfileStream::ProfileStream(std::uint64_t session, GrantedProfile granted, const SceneModel& model)
    : session_(session), granted_(std::move(granted)), encoder_(session, granted_) {
  use(model);
}

void ProfileStream::use(const SceneModel& model) {
  chosen_ = chosen_bodies(granted_.profile, model);
  SceneModel own{model.generation, {}};
  for (const auto place : chosen_) own.bodies.push_back(model.bodies[place]);
  model_datagrams_ = encode_model(session_, own, granted_.number);
}

std::span<const std::span<const std::byte>> ProfileStream::encode(const SceneFrame& frame) {
  const std::uint64_t step = step_of(granted_.profile, frame.rate_hz);
  if (frame.number % step != 0) return {};
  return encoder_.encode(frame, chosen_, step);
}

}  // namespace fiducap::native
