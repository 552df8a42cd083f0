#include "daemon/bodies/unseen_tags.hpp"

#include "base/log.hpp"
#include "daemon/system.hpp"

namespace fiducap {

void UnseenTags::note(const SharedImage& image, Instant at, bool has_tags) {
  if (has_tags) {
    if (std::exchange(sees_tags_, true)) return;
    kept_at_.reset();
    const std::lock_guard lock(mutex_);
    images_.clear();
    taken_at_.reset();
    why_.clear();
    return;
  }
  sees_tags_ = false;
  const bool is_due = !kept_at_ || at < *kept_at_ || at - *kept_at_ >= kEvery;
  if (image == nullptr || !is_due) return;
  kept_at_ = at;
  const std::lock_guard lock(mutex_);
  const bool is_again = !taken_at_ || at < *taken_at_ || at - *taken_at_ >= kAgain;
  if (is_again && images_.size() < kEnough) images_.push_back(image);
}

std::vector<SharedImage> UnseenTags::take() {
  const std::lock_guard lock(mutex_);
  if (images_.size() < kEnough) return {};
  taken_at_ = kept_at_;
  return std::exchange(images_, {});
}

void UnseenTags::answer(std::string why) {
  const std::lock_guard lock(mutex_);
  if (taken_at_) why_ = std::move(why);  // else tags are seen by now
}

std::string UnseenTags::why() const {
  const std::lock_guard lock(mutex_);
  return why_;
}

void SecondLooks::run(std::stop_token stop) {
  constexpr Duration kPause = std::chrono::milliseconds(500);
  set_background_priority();
  while (clock_.wait_until(clock_.now() + kPause, stop))
    log::guarded(
        "watch", [] { return "a second look at images"; }, [&] { look(stop); });
}

void SecondLooks::look(const std::stop_token& stop) {
  for (UnseenTags* body : bodies_)
    if (const auto images = body->take(); !images.empty()) body->answer(why_(images, stop));
}

}  // namespace fiducap
