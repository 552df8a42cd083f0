#include "daemon/views/body_views.hpp"

#include <utility>
#include <variant>

namespace fiducap {

namespace {

constexpr double kEarly = 0.05;  // of the wished period: an image this early is in time
constexpr double kSmooth = 0.2;  // share of the newest of the times between two images
constexpr double kPause_s = 5;   // a longer one says nothing of the rate

}  // namespace

void BodyViews::note(const SensorSample& sample) {
  chosen_ = nullptr;
  if (const auto* frame = std::get_if<CameraFrame>(&sample))
    return note(frame->camera, frame->exposed_at, frame->image);
  if (const auto* corners = std::get_if<CornerFrame>(&sample))
    note(corners->camera, corners->exposed_at, nullptr);
}

void BodyViews::note(int camera, Instant at, const std::shared_ptr<const GrayImage>& image) {
  if (camera < 0 || static_cast<std::size_t>(camera) >= cameras_.size()) return;
  Camera& one = cameras_[static_cast<std::size_t>(camera)];
  const auto wish = one.post->wish();
  if (!wish) {
    one.last_at.reset();
    one.due_at.reset();
    return;
  }
  const double since_s = one.last_at ? to_seconds(at - *one.last_at) : 0;
  if (since_s > 0 && since_s < kPause_s)
    one.period_s = one.period_s > 0 ? one.period_s + kSmooth * (since_s - one.period_s) : since_s;
  one.last_at = at;
  const Duration period = from_seconds(1.0 / wish->per_second);
  const bool runs_backwards = one.due_at && *one.due_at - at > 2 * period;
  if (one.due_at && !runs_backwards && at + from_seconds(kEarly / wish->per_second) < *one.due_at)
    return;
  const bool on_beat = one.due_at && !runs_backwards && at < *one.due_at + period;
  one.due_at = (on_beat ? *one.due_at : at) + period;
  chosen_ = &one;
  image_ = image;
}

void BodyViews::show(const BodyPipeline& pipeline, const BodyUpdate& update, const TagMap& map) {
  Camera* const one = std::exchange(chosen_, nullptr);
  if (one == nullptr) return;
  CameraView& view = one->post->seen.writing();
  view.image = std::move(image_);
  view.rate_hz = one->period_s > 0 ? 1 / one->period_s : 0;
  fill(view, pipeline, update, map);
  one->post->seen.offer();
  one->post->seen.writing().image.reset();  // one that is not needed any more goes here, not there
  bell_->ring();
}

}  // namespace fiducap
