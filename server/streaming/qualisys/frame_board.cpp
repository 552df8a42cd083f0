#include "streaming/qualisys/frame_board.hpp"

namespace fiducap::qualisys {

void FrameBoard::put(const std::shared_ptr<const SceneFrame>& frame, const BodyTable& bodies) {
  number_ = frame->number;
  frame_ = frame;
  bodies_ = &bodies;
  kept_.clear();
  if (hold_) begin();  // what is held may be seen in any frame
}

void FrameBoard::begin() {
  encoder_.begin(*frame_, bodies_->entries().size(), bodies_->index_of_body());
  frame_.reset();
}

std::shared_ptr<const EncodedFrame> FrameBoard::encoded(const Profile& profile) {
  for (const Kept& kept : kept_) {
    if (kept.profile == profile) return kept.frame;
  }
  if (frame_ != nullptr) begin();
  auto out = pool_.acquire();
  encoder_.encode(profile, *out);
  kept_.push_back({profile, out});
  return out;
}

}  // namespace fiducap::qualisys
