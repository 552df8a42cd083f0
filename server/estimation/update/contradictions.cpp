#include "estimation/update/contradictions.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {
// Bound of the memory; more ids at once are no moved tags.
constexpr std::size_t kMostScores = 256;
// Exclusion after the second removal, doubled with each further one. The first may be a moved tag.
constexpr Duration kFirstPause = std::chrono::seconds(20);
constexpr int kMostDoublings = 6;
// Age of removals that do not count any more.
constexpr Duration kForgotten = std::chrono::minutes(30);
// Images of proven tags before a decision.
constexpr int kAgainst = 5;
// Twice the log likelihood ratio of a decision: e³ = 20 times.
constexpr double kDecisive = 6.0;
// Position error of a single tag over a few images, 1-sigma per axis.
constexpr double kByOneTag_m = 0.05;
// Prior of a tag that was moved while the body did not see any: probability and distance, 1-sigma.
constexpr double kMovedWhileUnseen = 0.2;
constexpr double kMovedBy_m = 0.5;

/// Of N(0, S), without the constant factor.
double density(const Eigen::Vector3d& x, const Eigen::Matrix3d& S) {
  return std::exp(-0.5 * x.dot(S.llt().solve(x))) / std::sqrt(S.determinant());
}
}  // namespace

bool TagScores::is_doubtful(int tag_id) const {
  return std::ranges::any_of(
      scores_, [&](const Score& s) { return s.tag_id == tag_id && s.rejected_alone >= kToDoubt; });
}

int TagScores::doubtful() const {
  return static_cast<int>(
      std::ranges::count_if(scores_, [](const Score& s) { return s.rejected_alone >= kToDoubt; }));
}

std::span<const int> TagScores::count(std::span<const TagToUse> used,
                                      const std::vector<bool>& accepted) {
  removed_.clear();
  const bool any = std::find(accepted.begin(), accepted.end(), true) != accepted.end();
  for (std::size_t i = 0; i < used.size(); ++i) {
    const int tag_id = used[i].seen->tag_id;
    if (accepted[i]) {
      std::erase_if(scores_, [&](const Score& s) { return s.tag_id == tag_id; });
      continue;
    }
    auto score = std::ranges::find(scores_, tag_id, &Score::tag_id);
    if (score == scores_.end()) {
      if (scores_.size() >= kMostScores) scores_.erase(scores_.begin());
      score = scores_.insert(scores_.end(), Score{tag_id, 0, 0});
    }
    ++(any ? score->rejected_in_row : score->rejected_alone);
  }
  if (!any) return removed_;
  const bool is_one = doubtful() == 1;
  for (Score& score : scores_) {
    if (score.rejected_in_row >= kToDrop || (is_one && score.rejected_alone >= kToDrop))
      removed_.push_back(score.tag_id);
    score.rejected_alone = 0;
  }
  std::erase_if(scores_, [&](const Score& s) {
    return std::ranges::find(removed_, s.tag_id) != removed_.end();
  });
  return removed_;
}

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

void Contradictions::reset() {
  scores_.clear();
  images_without_fit_ = 0;
  contradicting_images_ = 0;
  std::ranges::fill(contradicting_of_, 0);
}

void UnstableTags::note_removal(int tag_id, Instant at) {
  auto known = std::ranges::find(tags_, tag_id, &Removal::tag_id);
  if (known == tags_.end()) {
    known = tags_.begin() + static_cast<std::ptrdiff_t>(next_);
    next_ = (next_ + 1) % tags_.size();
    *known = {tag_id, 0, at};
  }
  if (at - known->last > kForgotten) known->times = 0;
  ++known->times;
  known->last = at;
}

bool UnstableTags::is_excluded(int tag_id, Instant now) const {
  const auto known = std::ranges::find(tags_, tag_id, &Removal::tag_id);
  if (known == tags_.end() || known->times < 2) return false;
  const int doublings = std::min(known->times - 2, kMostDoublings);
  return now - known->last < kFirstPause * (1 << doublings);
}

void SingleTagRelocalisation::begin(int tag_id, const std::optional<BodyPlace>& before,
                                    const Eigen::Vector3d& p_WB_now) {
  forget();
  tag_id_ = tag_id;
  before_ = before;
  const double moved2 = kMovedBy_m * kMovedBy_m;
  if (!before) {
    mixture_ = kMovedWhileUnseen * moved2 * Eigen::Matrix3d::Identity();
    return;
  }
  moved_W_ = p_WB_now - before->p_WB;
  const Eigen::Matrix3d S =
      before->covariance + kByOneTag_m * kByOneTag_m * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d S_moved = S + moved2 * Eigen::Matrix3d::Identity();
  const double in_place = (1 - kMovedWhileUnseen) * density(moved_W_, S);
  const double moved = kMovedWhileUnseen * density(moved_W_, S_moved);
  if (!(in_place + moved > 0)) return;
  const double share = moved / (in_place + moved);
  mixture_ = share * (S + moved_W_ * moved_W_.transpose());
}

SingleTagRelocalisation::Verdict SingleTagRelocalisation::contradict(
    std::span<const int> against, const std::optional<Eigen::Vector3d>& shift_W) {
  are_several_ |= against.size() > 1 || against_.value_or(against.front()) != against.front();
  against_ = against.front();
  if (shift_W) shifts_W_ += *shift_W;
  shifts_ += shift_W ? 1 : 0;
  if (++images_against_ < kAgainst) return Verdict::kOpen;
  if (are_several_ || !before_ || shifts_ == 0) return Verdict::kTagWrong;
  const Eigen::LLT<Eigen::Matrix3d> P(before_->covariance +
                                      kByOneTag_m * kByOneTag_m * Eigen::Matrix3d::Identity());
  const Eigen::Vector3d by_others = moved_W_ + shifts_W_ / shifts_;
  const double likelier = by_others.dot(P.solve(by_others)) - moved_W_.dot(P.solve(moved_W_));
  return likelier > kDecisive ? Verdict::kOthersWrong : Verdict::kTagWrong;
}

}  // namespace fiducap
