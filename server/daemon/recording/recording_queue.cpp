#include "daemon/recording/recording_queue.hpp"

#include <utility>

namespace fiducap {

namespace {

/// Beside the item itself.
struct Attached {
  std::size_t operator()(const SessionBegin&) const { return 0; }
  std::size_t operator()(const SessionEnd&) const { return 0; }
  std::size_t operator()(const MapTurn&) const { return 0; }
  std::size_t operator()(const RefinementTurn&) const { return 0; }
  std::size_t operator()(const SensorSample& sample) const { return std::visit(*this, sample); }
  std::size_t operator()(const ImuSample&) const { return 0; }
  std::size_t operator()(const CameraFrame& frame) const {
    return frame.image ? sizeof(GrayImage) + frame.image->pixels.capacity() : 0;
  }
  std::size_t operator()(const CornerFrame& frame) const {
    return frame.tags.capacity() * sizeof(TagSighting) +
           frame.points.capacity() * sizeof(PointSighting);
  }
};

bool is_border(const RecordedThing& what) {
  return std::holds_alternative<SessionBegin>(what) || std::holds_alternative<SessionEnd>(what);
}

bool is_image(const RecordedThing& what) {
  const auto* sample = std::get_if<SensorSample>(&what);
  return sample != nullptr && !std::holds_alternative<ImuSample>(*sample);
}

}  // namespace

bool RecordingQueue::put(RecordedItem item) {
  item.bytes = sizeof(RecordedItem) + std::visit(Attached{}, item.what);
  const std::size_t limit = is_image(item.what) ? kImages_bytes : kMost_bytes;
  if (!is_border(item.what) && bytes_ + item.bytes > limit) return false;
  bytes_ += item.bytes;
  waiting_.push_back(std::move(item));
  return true;
}

void RecordingQueue::take_all(std::deque<RecordedItem>& out) {
  out.clear();
  out.swap(waiting_);
}

}  // namespace fiducap
