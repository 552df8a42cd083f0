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
    if (sample->has_value() && !told_.empty()) {
      told_.clear();
      pause_ = kShortestPause;
      listener_.back();
    }
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

void ReopeningSource::lose(const Error& why) {
  source_.reset();  // lets go of the device, which could not be opened otherwise
  std::string text = why.text();
  if (text == told_) return;
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
