#include "estimation/checks/rejection_watch.hpp"

#include <algorithm>

namespace fiducap {

namespace {
constexpr double kLarge = 0.3;
constexpr double kSmallAgain = 0.15;
// Fewer tags than this in ten seconds are no majority of anything.
constexpr int kFewest = 50;
constexpr Duration kSecond = std::chrono::seconds(1);
// One bad moment is not a bad installation: most of the seconds must be bad.
constexpr double kBadSecond = 0.2;
constexpr int kBadSeconds = 7;

double share_of(int rejected, int used) {
  return static_cast<double>(rejected) / std::max(1, rejected + used);
}
}  // namespace

std::optional<double> RejectionWatch::add(const UpdateReport& report) {
  if (!begun_at_) begun_at_ = report.exposed_at;
  const Duration since = report.exposed_at - *begun_at_;
  std::optional<double> news;
  if (since >= kSecond || since < Duration{0}) {
    begun_at_ = report.exposed_at;
    seconds_[full_++ % kSeconds] = now_;
    now_ = {};
    news = judge();
  }
  now_.used += report.tags_used;
  now_.rejected += report.tags_rejected;
  return news;
}

std::optional<double> RejectionWatch::judge() {
  if (full_ < kSeconds) return std::nullopt;
  Second sum;
  int bad = 0;
  for (const Second& second : seconds_) {
    sum.used += second.used;
    sum.rejected += second.rejected;
    if (share_of(second.rejected, second.used) > kBadSecond) ++bad;
  }
  const double share = share_of(sum.rejected, sum.used);
  if (share < kSmallAgain) said_ = false;
  if (said_ || bad < kBadSeconds || share < kLarge || sum.used + sum.rejected < kFewest)
    return std::nullopt;
  said_ = true;
  return share;
}

}  // namespace fiducap
