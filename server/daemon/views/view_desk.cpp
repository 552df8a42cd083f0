#include "daemon/views/view_desk.hpp"

#include <algorithm>
#include <utility>

#include "capture/jpeg_image.hpp"
#include "daemon/system_clock.hpp"
#include "daemon/urgency.hpp"
#include "detection/image_measures.hpp"
#include "streaming/net/guard.hpp"
#include "streaming/web/view_codec.hpp"

namespace fiducap {

ViewDesk::ViewDesk(TagSetConfig tags, DetectorConfig detector, const Clock& clock)
    : tags_(std::move(tags)), detector_(std::move(detector)), clock_(clock) {}

BodyViews ViewDesk::add(int body_id, const BodySensors& sensors) {
  std::vector<CameraPost*> posts;
  for (const CameraMount& mount : sensors.cameras) {
    cameras_.push_back({body_id, static_cast<int>(posts.size()), mount.model.width,
                        mount.model.height, mount.rate_hz});
    posts_.push_back(std::make_unique<CameraPost>());
    posts.push_back(posts_.back().get());
  }
  return {std::move(posts), bell_};
}

void ViewDesk::run(std::stop_token stop) {
  run_patiently();
  const std::stop_callback ended(stop, [this] { bell_.ring(); });
  for (std::uint32_t heard = 0; !stop.stop_requested(); heard = bell_.wait(heard)) {
    net::guarded(
        "views", [] { return "a picture"; }, [this] { make_pictures(); });
  }
}

void ViewDesk::make_pictures() {
  for (std::size_t i = 0; i < posts_.size(); ++i) {
    CameraPost& post = *posts_[i];
    const bool is_new = post.seen.fetch();  // also where nobody watches: it would be old later
    const auto wish = post.wish();
    if (is_new && wish) make_picture(post, cameras_[i], *wish);
  }
}

void ViewDesk::look_for_candidates(const CameraView& view, bool wanted) {
  candidates_.clear();
  if (!wanted) return;
  if (!candidate_search_) candidate_search_ = std::make_unique<CandidateSearch>(tags_, detector_);
  candidate_search_->search(*view.image, view.sightings, candidates_);
}

void ViewDesk::make_picture(CameraPost& post, const Camera& camera, const ViewWish& wish) {
  const CameraView& view = post.seen.reading();
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
    picture.has_candidates = wish.candidates;
    look_for_candidates(view, wish.candidates);
    scale_down(*view.image, wish.width_px, scaled_, sums_);
    encode_jpeg(scaled_, jpeg_);
    picture.shown_width = scaled_.width;
    picture.shown_height = scaled_.height;
  }
  picture.candidates = candidates_;
  post.made.writing() = std::make_shared<const std::string>(web::encode_view(view, picture, jpeg_));
  post.made.offer();
  ++pictures_;
}

void ViewDesk::watch(std::size_t camera, const std::optional<ViewWish>& wish) {
  CameraPost& post = *posts_[camera];
  if (!post.wish()) (void)post.made.fetch();  // of an earlier time
  post.watch(wish);
}

CameraViews::Picture ViewDesk::take(std::size_t camera) {
  CameraPost& post = *posts_[camera];
  if (!post.made.fetch()) return nullptr;
  return std::exchange(post.made.reading(), nullptr);
}

}  // namespace fiducap
