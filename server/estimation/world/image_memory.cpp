#include "estimation/world/image_memory.hpp"

#include <algorithm>

#include "estimation/imu/imu_buffer.hpp"
#include "estimation/world/workspace_axes.hpp"

namespace fiducap::world {

void ImageMemory::forget_all() {
  waiting_.clear();
  for (Checkpoint& checkpoint : checkpoints_) checkpoint.number = -1;
}

void ImageMemory::forget_tag(int tag_id) {
  const auto is_it = [&](const auto& entry) { return entry.tag_id == tag_id; };
  stop_waiting(tag_id);
  for (Image& image : images_) {
    std::erase_if(image.admissions, is_it);
    std::erase_if(image.known, is_it);
  }
  for (Checkpoint& checkpoint : checkpoints_) {
    const int tag = checkpoint.number < 0 ? -1 : checkpoint.state.find(tag_id);
    if (tag >= 0) checkpoint.state.remove_tag(static_cast<std::size_t>(tag));
  }
}

void ImageMemory::add(const TagObservations& seen, std::span<const KnownTag> known) {
  ++newest_;
  std::erase_if(waiting_, [&](const FirstSight& first) {
    return first.number <= newest_ - kImages ||
           seen.exposed_at - image(first.number).seen.exposed_at > kFilterPast;
  });
  free_unneeded();
  Image& image = images_[slot(newest_)];
  image.seen = seen;
  image.known.assign(known.begin(), known.end());
  image.admissions.clear();
}

void ImageMemory::free_unneeded() {
  for (Checkpoint& checkpoint : checkpoints_) {
    const bool needed = std::ranges::any_of(
        waiting_, [&](const FirstSight& first) { return first.number == checkpoint.number; });
    if (!needed) checkpoint.number = -1;
  }
}

void ImageMemory::wait(int tag_id, const Eigen::Quaterniond& q_LV, const FilterState& state) {
  if (first_sight(tag_id)) return;
  if (state_at(newest_) == nullptr) {
    const auto free =
        std::ranges::find_if(checkpoints_, [](const auto& c) { return c.number < 0; });
    if (free == checkpoints_.end()) return;
    free->number = newest_;
    free->state = state;
  }
  waiting_.push_back({tag_id, newest_, q_LV});
}

void ImageMemory::stop_waiting(int tag_id) {
  std::erase_if(waiting_, [&](const FirstSight& first) { return first.tag_id == tag_id; });
  free_unneeded();
}

std::optional<ImageMemory::FirstSight> ImageMemory::first_sight(int tag_id) const {
  const auto found = std::ranges::find(waiting_, tag_id, &FirstSight::tag_id);
  return found == waiting_.end() ? std::nullopt : std::optional(*found);
}

const FilterState* ImageMemory::state_at(long number) const {
  const auto found = std::ranges::find(checkpoints_, number, &Checkpoint::number);
  return found == checkpoints_.end() ? nullptr : &found->state;
}

void ImageMemory::renew(long number, const FilterState& state) {
  for (Checkpoint& checkpoint : checkpoints_)
    if (checkpoint.number == number) checkpoint.state = state;
}

void ImageMemory::move_axes(const Pose& G) {
  for (Checkpoint& checkpoint : checkpoints_)
    if (checkpoint.number >= 0) world::move_axes(checkpoint.state, G);
}

std::optional<Instant> ImageMemory::needed_since() const {
  std::optional<Instant> oldest;
  for (const Checkpoint& checkpoint : checkpoints_)
    if (checkpoint.number >= 0 && (!oldest || checkpoint.state.time < *oldest))
      oldest = checkpoint.state.time;
  return oldest;
}

}  // namespace fiducap::world
