#include "src/clock_sync.hpp"

#include <cmath>

namespace fiducap::sdk {

namespace {

// A first estimate in a fifth of a second, then ten samples per second: 64 bytes each.
constexpr int kQuickQuestions = 8;
constexpr Nanoseconds kQuickPause = 25 * kMillisecond;
constexpr Nanoseconds kPause = 100 * kMillisecond;

}  // namespace

void ClockSync::start(Nanoseconds now) {
  filter_.reset();
  for (auto& question : questions_) question.asked = -1;
  asked_ = 0;
  due_at_ = now;
}

std::uint64_t ClockSync::ask(Nanoseconds now) {
  const std::uint64_t number = next_number_++;
  questions_[number % questions_.size()] = {number, now};
  ++asked_;
  due_at_ = now + (asked_ < kQuickQuestions ? kQuickPause : kPause);
  return number;
}

void ClockSync::on(const ClockReply& reply, Nanoseconds now) {
  Question& question = questions_[reply.number % questions_.size()];
  if (question.asked < 0 || question.number != reply.number) return;
  filter_.add({question.asked, reply.received, reply.answered, now});
  question.asked = -1;
}

ClockEstimate ClockSync::at(Nanoseconds now, bool same_machine) const {
  ClockEstimate estimate = filter_.at(now);
  if (same_machine && estimate.known &&
      std::abs(static_cast<double>(estimate.offset)) * 1e-9 <= estimate.bound_s) {
    estimate.offset = 0;
    estimate.drift = 0;
    estimate.sigma_s = 0;
    estimate.bound_s = 0;
  }
  return estimate;
}

}  // namespace fiducap::sdk
