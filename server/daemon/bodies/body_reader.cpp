#include "daemon/bodies/body_reader.hpp"

#include <exception>

#include "base/log.hpp"

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
        waiting_.erase(std::ranges::find_if(waiting_, is_image));
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

void BodyInbox::finish() { set_and_notify(finished_); }
void BodyInbox::close() { set_and_notify(closed_); }
void BodyInbox::wake() { set_and_notify(woken_); }

void BodyInbox::set_and_notify(bool& flag) {
  {
    const std::lock_guard lock(mutex_);
    flag = true;
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

BodyReader::BodyReader(BodySource source, std::string body, Take take, EventBoard& events,
                       const Clock& clock)
    : source_(std::move(source)),
      body_(std::move(body)),
      take_(std::move(take)),
      events_(events),
      clock_(clock) {
  for (const ImageWatch::Nominal& nominal : source_.nominal) watches_.emplace_back(nominal);
}

void BodyReader::read(std::stop_token stop) {
  Backoff backoff(std::chrono::milliseconds(100));
  for (;;) {
    const Instant began = clock_.now();
    try {
      read_samples(stop);
      break;
    } catch (const std::exception& failure) {
      report_failure(failure.what());
    }
    const Instant now = clock_.now();
    if (!clock_.wait_until(now + backoff.pause_after(now - began), stop)) break;
  }
  reading_ = false;
}

void BodyReader::report_failure(const char* why) {
  failed_ = true;
  const auto whose = [this] { return body_; };
  log::guarded("capture", whose, [&] {
    events_.begin({.severity = Severity::kError,
                   .subject = body_,
                   .kind = "source_failed",
                   .text = source_.name + " error (" + why + "); retrying",
                   .remedy = "If it happens again, this is a defect: please report it"});
  });
}

void BodyReader::read_samples(std::stop_token stop) {
  while (!stop.stop_requested()) {
    auto sample = source_.samples->next(stop);
    if (!sample)
      return log::error("capture", body_ + ": " + source_.name + " lost: " + sample.error().text());
    if (!sample->has_value()) {
      if (!stop.stop_requested()) log::info("capture", body_ + ": " + source_.name + " has ended");
      return;
    }
    if (std::exchange(failed_, false))
      events_.end(body_, "source_failed", "its " + source_.name + " gives samples again");
    if (const auto* image = std::get_if<CameraFrame>(&**sample)) check(*image);
    if (!take_(std::move(**sample))) return;
  }
}

void BodyReader::check(const CameraFrame& image) {
  const auto camera = static_cast<std::size_t>(image.camera);
  if (image.camera < 0 || camera >= watches_.size() || !image.image) return;
  for (const ImageCondition& doubt : watches_[camera].take(image)) report(camera, doubt);
}

void BodyReader::report(std::size_t camera, const ImageCondition& doubt) {
  const bool is_only = watches_.size() == 1;
  const std::string number = std::to_string(camera);
  const std::string text = (is_only ? "its camera: " : "its camera " + number + ": ") + doubt.text;
  events_.set(doubt.holds,
              {.severity = Severity::kWarning,
               .subject = body_,
               .kind = std::string(name_of(doubt.fault)) + (is_only ? "" : "_" + number),
               .text = text,
               .remedy = doubt.remedy},
              text);
}

}  // namespace fiducap
