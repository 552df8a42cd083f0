#include "daemon/bodies/body_inbox.hpp"

#include <algorithm>
#include <utility>

namespace fiducap {

namespace {

bool is_image(const Delivery& delivery) {
  return !std::holds_alternative<ImuSample>(delivery.sample);
}

}  // namespace

BodyInbox::BodyInbox(std::size_t max_images) : max_images_(max_images) {
  waiting_.reserve(kMaxImu + max_images + 1);
}

bool BodyInbox::push(SensorSample sample, Instant arrived) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_ || finished_) return false;
    Delivery delivery{std::move(sample), arrived};
    if (is_image(delivery)) {
      if (images_ == max_images_) {
        waiting_.erase(std::find_if(waiting_.begin(), waiting_.end(), is_image));
        ++images_dropped_;
      } else {
        ++images_;
      }
    } else if (waiting_.size() - images_ == kMaxImu) {
      waiting_.clear();
      images_ = 0;
      ++overflows_;
    }
    waiting_.push_back(std::move(delivery));
  }
  filled_.notify_one();
  return true;
}

void BodyInbox::finish() {
  {
    const std::lock_guard lock(mutex_);
    finished_ = true;
  }
  filled_.notify_one();
}

void BodyInbox::close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  filled_.notify_one();
}

void BodyInbox::wake() {
  {
    const std::lock_guard lock(mutex_);
    woken_ = true;
  }
  filled_.notify_one();
}

bool BodyInbox::take(std::vector<Delivery>& out, std::stop_token stop) {
  out.clear();
  std::unique_lock lock(mutex_);
  filled_.wait(lock, stop, [this] { return !waiting_.empty() || finished_ || closed_ || woken_; });
  const bool woken = std::exchange(woken_, false);
  if (closed_ || stop.stop_requested() || (waiting_.empty() && !woken)) return false;
  if (out.capacity() < waiting_.capacity()) out.reserve(waiting_.capacity());
  out.swap(waiting_);
  images_ = 0;
  return true;
}

void BodyInbox::clear() {
  const std::lock_guard lock(mutex_);
  waiting_.clear();
  images_ = 0;
}

std::uint64_t BodyInbox::overflows() const {
  const std::lock_guard lock(mutex_);
  return overflows_;
}

std::uint64_t BodyInbox::images_dropped() const {
  const std::lock_guard lock(mutex_);
  return images_dropped_;
}

}  // namespace fiducap
