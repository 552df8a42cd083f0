#include "daemon/bodies/reopening_source.hpp"

#include <algorithm>
#include <exception>
#include <utility>

namespace fiducap {

ReopeningSource::ReopeningSource(Expected<std::unique_ptr<SensorSource>> first, Open open,
                                 Listener listener, const Clock& clock)
    : open_(std::move(open)), listener_(std::move(listener)), clock_(clock) {
  if (first) {
    source_ = std::move(*first);
  } else {
    at_start_ = std::move(first.error());
  }
}

Expected<std::optional<SensorSample>> ReopeningSource::next(std::stop_token stop) {
  if (at_start_) lose(*std::exchange(at_start_, std::nullopt));
  while (!stop.stop_requested()) {
    if (!source_ && !wait_and_reopen(stop)) continue;
    auto sample = ask(stop);
    if (!sample) {
      lose(sample.error());
      continue;
    }
    if (sample->has_value()) note_sample();
    return sample;
  }
  return std::nullopt;
}

Expected<std::optional<SensorSample>> ReopeningSource::ask(std::stop_token stop) {
  try {
    return source_->next(std::move(stop));
  } catch (const std::exception& failure) {
    return fail(ErrorCode::kUnavailable, failure.what());
  }
}

/// One sample is not yet a device that works.
void ReopeningSource::note_sample() {
  gave_at_ = clock_.now();
  if (!gives_since_) gives_since_ = gave_at_;
  if (told_.empty() || gave_at_ - *gives_since_ < kBackAfter) return;
  told_.clear();
  listener_.back();
}

void ReopeningSource::lose(const Error& why) {
  source_.reset();  // lets go of the device, which could not be opened otherwise
  const auto gave_since = std::exchange(gives_since_, std::nullopt);
  if (gave_since && gave_at_ - *gave_since >= kForgiven) pause_ = kShortestPause;
  std::string text = why.text();
  if (text == told_ && !gave_since) return;
  told_ = std::move(text);
  listener_.lost(why);
}

bool ReopeningSource::wait_and_reopen(std::stop_token stop) {
  if (!clock_.wait_until(clock_.now() + pause_, stop)) return false;
  pause_ = std::min(2 * pause_, kLongestPause);
  try {
    auto opened = open_();
    if (opened) {
      source_ = std::move(*opened);
    } else {
      lose(opened.error());
    }
  } catch (const std::exception& failure) {
    lose(Error{ErrorCode::kUnavailable, failure.what(), {}});
  }
  return source_ != nullptr;
}

}  // namespace fiducap
