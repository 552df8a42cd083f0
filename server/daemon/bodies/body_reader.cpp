#include "daemon/bodies/body_reader.hpp"

#include <algorithm>
#include <exception>
#include <utility>

#include "base/log.hpp"
#include "streaming/net/guard.hpp"

namespace fiducap {

namespace {

// A source that was read for this long before it threw is read on at once.
constexpr Duration kForgivenAfter = std::chrono::minutes(1);
constexpr Duration kFirstPause = std::chrono::milliseconds(100);
constexpr Duration kLastPause = std::chrono::seconds(30);

}  // namespace

BodyReader::BodyReader(BodySource source, std::string body, Take take, EventBoard& events,
                       const Clock& clock)
    : source_(std::move(source)),
      body_(std::move(body)),
      take_(std::move(take)),
      events_(events),
      clock_(clock) {
  for (const ImageWatch::Promise& promise : source_.promises) watches_.emplace_back(promise);
}

void BodyReader::read(std::stop_token stop) {
  Duration pause = kFirstPause;
  for (;;) {
    const Instant began = clock_.now();
    try {
      read_samples(stop);
      break;
    } catch (const std::exception& failure) {
      say_that_it_failed(failure.what());
    }
    const Instant now = clock_.now();
    if (now - began > kForgivenAfter) pause = kFirstPause;
    if (!clock_.wait_until(now + pause, stop)) break;
    pause = std::min(2 * pause, kLastPause);
  }
  reading_ = false;
}

void BodyReader::say_that_it_failed(const char* why) {
  failed_ = true;
  const auto whose = [this] { return body_; };
  net::guarded("capture", whose, [&] {
    events_.begin({.severity = Severity::kError,
                   .subject = body_,
                   .kind = "source_failed",
                   .text = "its " + source_.name + " failed (" + why + ") and is read on",
                   .remedy = "If it comes again, this is a defect: please report it"});
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
    if (const auto* image = std::get_if<CameraFrame>(&**sample)) look_at(*image);
    if (!take_(std::move(**sample))) return;
  }
}

void BodyReader::look_at(const CameraFrame& image) {
  const auto camera = static_cast<std::size_t>(image.camera);
  if (image.camera < 0 || camera >= watches_.size() || !image.image) return;
  for (const ImageDoubt& doubt : watches_[camera].take(image)) tell(camera, doubt);
}

void BodyReader::tell(std::size_t camera, const ImageDoubt& doubt) {
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
