#include "estimation/conversation/contradictions.hpp"

#include <algorithm>

namespace fiducap {

std::span<const int> Contradictions::count(int camera, Instant exposed_at,
                                           std::span<const TagToUse> used,
                                           const std::vector<bool>& accepted) {
  const auto fit = std::count(accepted.begin(), accepted.end(), true);
  images_without_fit_ = fit > 0 ? 0 : images_without_fit_ + 1;
  const bool contradicts = 2 * fit <= static_cast<std::ptrdiff_t>(used.size());
  const auto k = static_cast<std::size_t>(camera);
  if (k >= contradicting_of_.size()) contradicting_of_.resize(k + 1, 0);
  for (int* const images : {&contradicting_images_, &contradicting_of_[k]})
    *images = contradicts ? *images + 1 : 0;
  if (fit > 0) last_fit_ = exposed_at;
  return scores_.count(used, accepted);
}

void Contradictions::pardon() {
  scores_.clear();
  images_without_fit_ = 0;
  contradicting_images_ = 0;
  std::fill(contradicting_of_.begin(), contradicting_of_.end(), 0);
}

}  // namespace fiducap
