#include "estimation/conversation/tag_scores.hpp"

namespace fiducap {

namespace {
// More ids than this at once are no tags that moved.
constexpr std::size_t kMostScores = 256;
}  // namespace

TagScores::Score& TagScores::score_of(int tag_id) {
  const auto found = std::find_if(scores_.begin(), scores_.end(),
                                  [&](const Score& s) { return s.tag_id == tag_id; });
  if (found != scores_.end()) return *found;
  if (scores_.size() >= kMostScores) scores_.erase(scores_.begin());
  return scores_.emplace_back(Score{tag_id, 0, 0});
}

bool TagScores::is_suspect(int tag_id) const {
  return std::any_of(scores_.begin(), scores_.end(), [&](const Score& s) {
    return s.tag_id == tag_id && s.rejected_alone >= kToSuspect;
  });
}

int TagScores::suspects() const {
  return static_cast<int>(std::count_if(scores_.begin(), scores_.end(), [](const Score& s) {
    return s.rejected_alone >= kToSuspect;
  }));
}

std::span<const int> TagScores::count(std::span<const TagToUse> used,
                                      const std::vector<bool>& accepted) {
  given_up_.clear();
  const bool any = std::find(accepted.begin(), accepted.end(), true) != accepted.end();
  for (std::size_t i = 0; i < used.size(); ++i) {
    const int tag_id = used[i].seen->tag_id;
    if (accepted[i]) {
      std::erase_if(scores_, [&](const Score& s) { return s.tag_id == tag_id; });
    } else {
      Score& score = score_of(tag_id);
      ++(any ? score.rejected_in_row : score.rejected_alone);
    }
  }
  if (!any) return given_up_;
  const bool is_one = suspects() == 1;
  for (Score& score : scores_) {
    if (score.rejected_in_row >= kToDrop || (is_one && score.rejected_alone >= kToDrop))
      given_up_.push_back(score.tag_id);
    score.rejected_alone = 0;
  }
  std::erase_if(scores_, [&](const Score& s) {
    return std::find(given_up_.begin(), given_up_.end(), s.tag_id) != given_up_.end();
  });
  return given_up_;
}

}  // namespace fiducap
