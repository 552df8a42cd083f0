#include "daemon/views/camera_preview.hpp"

#include <utility>
#include <variant>

#include "base/log.hpp"
#include "capture/gray_image.hpp"
#include "daemon/system.hpp"
#include "detection/image_measures.hpp"
#include "streaming/web/view_codec.hpp"

namespace fiducap {
namespace {

constexpr double kEarly = 0.05;  // of the requested period: an image this early is in time
constexpr double kSmooth = 0.2;  // weight of the newest interval
constexpr double kPause_s = 5;   // longer intervals are pauses

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
  const auto request = one.latest->request();
  if (!request) {
    one.last_at.reset();
    one.due_at.reset();
    return;
  }
  const double since_s = one.last_at ? to_seconds(at - *one.last_at) : 0;
  if (since_s > 0 && since_s < kPause_s)
    one.period_s = one.period_s > 0 ? one.period_s + kSmooth * (since_s - one.period_s) : since_s;
  one.last_at = at;
  const Duration period = from_seconds(1.0 / request->per_second);
  const bool runs_backwards = one.due_at && *one.due_at - at > 2 * period;
  if (one.due_at && !runs_backwards &&
      at + from_seconds(kEarly / request->per_second) < *one.due_at)
    return;
  const bool on_beat = one.due_at && !runs_backwards && at < *one.due_at + period;
  one.due_at = (on_beat ? *one.due_at : at) + period;
  chosen_ = &one;
  image_ = image;
}

void BodyViews::show(const BodyPipeline& pipeline, const BodyUpdate& update, const TagMap& map) {
  Camera* const one = std::exchange(chosen_, nullptr);
  if (one == nullptr) return;
  CameraView& view = one->latest->seen.writing();
  view.image = std::move(image_);
  view.rate_hz = one->period_s > 0 ? 1 / one->period_s : 0;
  fill(view, pipeline, update, map);
  one->latest->seen.offer();
  one->latest->seen.writing().image.reset();  // an unused one is freed by this thread
  wake_->notify();
}

CameraPreview::CameraPreview(TagSetConfig tags, DetectorConfig detector, const Clock& clock)
    : tags_(std::move(tags)), detector_(std::move(detector)), clock_(clock) {}

BodyViews CameraPreview::add(int body_id, const BodySensors& sensors) {
  std::vector<LatestImage*> posts;
  for (const CameraMount& mount : sensors.cameras) {
    cameras_.push_back({body_id, static_cast<int>(posts.size()), mount.model.width,
                        mount.model.height, mount.rate_hz});
    latest_.push_back(std::make_unique<LatestImage>());
    posts.push_back(latest_.back().get());
  }
  return {std::move(posts), wake_};
}

void CameraPreview::run(std::stop_token stop) {
  set_background_priority();
  const std::stop_callback ended(stop, [this] { wake_.notify(); });
  for (std::uint32_t seen = 0; !stop.stop_requested(); seen = wake_.wait(seen))
    log::guarded(
        "views", [] { return "a picture"; }, [this] { make_pictures(); });
}

void CameraPreview::make_pictures() {
  for (std::size_t i = 0; i < latest_.size(); ++i) {
    LatestImage& latest = *latest_[i];
    const bool is_new = latest.seen.fetch();  // also without a viewer: it would be old later
    const auto request = latest.request();
    if (is_new && request) make_picture(latest, cameras_[i], *request);
  }
}

void CameraPreview::make_picture(LatestImage& latest, const Camera& camera,
                                 const ViewRequest& request) {
  const CameraView& view = latest.seen.reading();
  web::ViewPicture picture;
  picture.body_id = camera.body_id;
  picture.blur = blur_of(view.sightings);
  const Duration age = clock_.now() - view.exposed_at;
  picture.utc_ms = (utc_now_ns() - age.count()) / 1'000'000;
  ImageMeasures measures;
  jpeg_.clear();
  candidates_.clear();
  if (view.image) {
    measures = measure(*view.image);
    picture.measures = &measures;
    picture.has_candidates = request.candidates;
    if (request.candidates) {
      if (!candidate_search_)
        candidate_search_ = std::make_unique<CandidateSearch>(tags_, detector_);
      candidate_search_->search(*view.image, view.sightings, candidates_);
    }
    scale_down(*view.image, request.width_px, scaled_, sums_);
    encode_jpeg(scaled_, jpeg_);
    picture.shown_width = scaled_.width;
    picture.shown_height = scaled_.height;
  }
  picture.candidates = candidates_;
  latest.made.writing() =
      std::make_shared<const std::string>(web::encode_view(view, picture, jpeg_));
  latest.made.offer();
  ++pictures_;
}

void CameraPreview::watch(std::size_t camera, const std::optional<ViewRequest>& request) {
  LatestImage& latest = *latest_[camera];
  if (!latest.request()) (void)latest.made.fetch();  // outdated
  latest.watch(request);
}

CameraViews::Picture CameraPreview::take(std::size_t camera) {
  LatestImage& latest = *latest_[camera];
  if (!latest.made.fetch()) return nullptr;
  return std::exchange(latest.made.reading(), nullptr);
}

}  // namespace fiducap
