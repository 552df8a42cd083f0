#include "estimation/conversation/contradictions.hpp"

#include <algorithm>

namespace fiducap {

std::span<const int> Contradictions::count(Instant exposed_at, std::span<const TagToUse> used,
                                           const std::vector<bool>& accepted) {
  const auto fit = std::count(accepted.begin(), accepted.end(), true);
  images_without_fit_ = fit > 0 ? 0 : images_without_fit_ + 1;
  contradicting_images_ =
      2 * fit > static_cast<std::ptrdiff_t>(used.size()) ? 0 : contradicting_images_ + 1;
  if (fit > 0) last_fit_ = exposed_at;
  return scores_.count(used, accepted);
}

void Contradictions::pardon() {
  scores_.clear();
  images_without_fit_ = 0;
  contradicting_images_ = 0;
}

}  // namespace fiducap
