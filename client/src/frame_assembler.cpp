#include "src/frame_assembler.hpp"

#include <algorithm>

namespace fiducap::sdk {

void PartList::start(const PartPlace& place) {
  seen_.reset();
  count_ = place.count;
  body_count_ = place.body_count;
  bodies_ = 0;
}

bool PartList::add(const PartPlace& place, std::size_t bodies) {
  if (place.count != count_ || place.body_count != body_count_ || seen_.test(place.index))
    return false;
  seen_.set(place.index);
  bodies_ += bodies;
  return true;
}

void FrameAssembler::begin(std::uint64_t session) {
  session_ = session;
  generation_ = 0;
  next_generation_ = 0;
  last_number_ = 0;
  lost_ = 0;
  received_ = 0;
  for (auto& frame : unfinished_) frame.number = 0;
}

void FrameAssembler::add(const ModelPart& part) {
  if (part.session != session_ || part.generation == generation_) return;
  if (part.generation != next_generation_) {
    next_generation_ = part.generation;
    next_parts_.start(part.place);
    next_model_.assign(part.place.body_count, {});
  }
  if (!next_parts_.add(part.place, part.bodies.size())) return;
  std::copy(part.bodies.begin(), part.bodies.end(), next_model_.begin() + part.place.first_body);
  if (!next_parts_.complete()) return;
  next_generation_ = 0;
  if (!next_parts_.consistent()) return;
  generation_ = part.generation;
  model_.swap(next_model_);
}

Frame* FrameAssembler::add(const FramePart& part) {
  if (part.session != session_ || generation_ == 0 || part.model_generation != generation_)
    return nullptr;
  Unfinished* place = place_for(part);
  if (place == nullptr || !place->parts.add(part.place, part.frame.bodies.size())) return nullptr;
  if (!put(part, place->frame)) {
    place->number = 0;
    return nullptr;
  }
  if (!place->parts.complete()) return nullptr;
  const std::uint64_t number = place->number;
  const std::uint64_t step = place->step;
  place->number = 0;
  if (!place->parts.consistent()) return nullptr;
  if (last_number_ != 0) lost_ += (number - last_number_ - 1) / step;
  last_number_ = number;
  ++received_;
  for (auto& other : unfinished_) {
    if (other.number < number) other.number = 0;
  }
  return &place->frame;
}

FrameAssembler::Unfinished* FrameAssembler::place_for(const FramePart& part) {
  const std::uint64_t number = part.frame.number;
  if (number <= last_number_) return nullptr;
  for (auto& place : unfinished_) {
    if (place.number == number) return &place;
  }
  auto* oldest =
      &*std::min_element(unfinished_.begin(), unfinished_.end(),
                         [](const auto& a, const auto& b) { return a.number < b.number; });
  if (oldest->number > number) return nullptr;
  oldest->number = number;
  oldest->step = part.step;
  oldest->parts.start(part.place);
  Frame& frame = oldest->frame;
  frame.number = number;
  frame.at_server_ns = part.frame.at_server_ns;
  frame.at_utc_ns = part.frame.at_utc_ns;
  frame.published_server_ns = part.frame.published_server_ns;
  frame.map_version = part.frame.map_version;
  frame.rate_hz = part.frame.rate_hz;
  frame.bodies.resize(part.place.body_count);
  for (auto& body : frame.bodies) body.id = 0;  // not arrived yet
  return oldest;
}

bool FrameAssembler::put(const FramePart& part, Frame& frame) const {
  for (std::size_t i = 0; i < part.frame.bodies.size(); ++i) {
    const Body& from = part.frame.bodies[i];
    const std::size_t at = part.place.first_body + i;
    if (at >= model_.size() || model_[at].first != from.id)
      return false;  // not the bodies of this model
    Body& to = frame.bodies[at];
    if (to.id != 0)
      return false;  // two parts for one place would leave another place with an old pose
    to = from;       // the name is empty in a part
    to.name = model_[at].second;
  }
  return true;
}

}  // namespace fiducap::sdk
