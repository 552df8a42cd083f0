#include "capture/v4l2/lost_images.hpp"

#include <utility>

#include "base/log.hpp"

namespace fiducap::v4l2 {

void LostImages::add(Cause cause, std::uint32_t images) {
  switch (cause) {
    case Cause::kSkipped:
      counts_.skipped += images;
      break;
    case Cause::kDamaged:
      counts_.damaged += images;
      break;
    case Cause::kShort:
      counts_.shortened += images;
      break;
    case Cause::kUnreadable:
      counts_.unreadable += images;
      break;
    case Cause::kOutOfOrder:
      counts_.out_of_order += images;
      break;
  }
  since_last_ += images;
  is_unsaid_ = true;
}

std::uint32_t LostImages::came(Instant now) {
  constexpr Duration kSaidEvery = std::chrono::minutes(1);
  if (is_unsaid_ && (!said_at_ || now - *said_at_ >= kSaidEvery)) {
    said_at_ = now;
    is_unsaid_ = false;
    log::warning("capture", device_ + ": images are missing, since it was opened " + text());
  }
  return std::exchange(since_last_, 0);
}

std::string LostImages::text() const {
  std::string all;
  const auto add = [&all](std::uint64_t count, const char* what) {
    if (count == 0) return;
    all += (all.empty() ? "" : ", ") + std::to_string(count) + what;
  };
  add(counts_.skipped, " left out before they reached us (a full USB bus, a busy computer)");
  add(counts_.damaged, " damaged on their way (cable, hub, power)");
  add(counts_.shortened, " of which a part is missing (cable, hub, power)");
  add(counts_.unreadable, " JPEGs that are damaged or end too early (cable, hub, power)");
  add(counts_.out_of_order, " stamped no later than the one before (its driver's clock)");
  return all;
}

}  // namespace fiducap::v4l2
