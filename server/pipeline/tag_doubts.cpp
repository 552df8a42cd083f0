#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "base/numeric.hpp"
#include "pipeline/doubts.hpp"

namespace fiducap {
namespace {

// A tag seen less often may still be anywhere.
constexpr int kSightingsToVote = 20;
constexpr int kFewestVoters = 3;
// A direction wins with this share of the tags, when the next one has at most this share of its
// votes. In a box of three walls a horizontal direction has two votes, and up has three.
constexpr double kMajority = 0.8;
constexpr double kNextAtMost = 0.8;
// Prints are inclined by up to this angle …
const double kSameWay = std::cos(10 / kDegreesPerRadian);
// … and a direction beyond this is another one.
const double kOtherWay = std::cos(25 / kDegreesPerRadian);
constexpr Duration kGuessPeriod = std::chrono::seconds(1);
constexpr Duration kFloorReportedAfter = std::chrono::seconds(10);

using Ways = std::array<Eigen::Vector3d, 3>;

/// Up for a tag on a wall, on the floor, and on the ceiling.
Ways ways_of(const TagBelief& tag) {
  const Eigen::Matrix3d R = tag.tag.X_WT.rotation();
  return {R.col(1), R.col(2), -R.col(2)};
}

bool agrees(const Ways& ways, const Eigen::Vector3d& up) {
  return std::ranges::any_of(ways, [&](const auto& w) { return w.dot(up) > kSameWay; });
}

std::string up_remedy() {
  return "Name tags that lie flat on the floor, face up (map.floor_tags), or measure the pose of "
         "the first tag (map.reference_tag with map.reference_pose)";
}

std::string axis_name(const Eigen::Vector3d& up) {
  int axis = 0;
  (void)up.cwiseAbs().maxCoeff(&axis);
  return fmt::format("{}{}", up(axis) > 0 ? '+' : '-', "xyz"[axis]);
}

std::string guess_text(const UpGuess& guess) {
  const double angle = kDegreesPerRadian * std::acos(std::clamp(guess.up_W.z(), -1.0, 1.0));
  if (guess.up_W.z() > kOtherWay)
    return fmt::format(
        "the vertical is guessed, but {} of {} tags agree with it (to {:.0f} deg): they are "
        "upright "
        "or flat",
        guess.agree, guess.of, angle);
  return fmt::format(
      "the workspace seems to lie on its side: by {} of {} tags, up is {:.0f} deg from its z axis, "
      "about along {}. It is not turned, since poses have been published. {}, forget this map, and "
      "start again",
      guess.agree, guess.of, angle, axis_name(guess.up_W), up_remedy());
}

constexpr std::size_t kMostTexts = 20;
constexpr double kPercent = 100;
constexpr Duration kBranchReportedAfter = std::chrono::seconds(5);
constexpr Duration kConflictReportedAfter = std::chrono::seconds(1);
constexpr double kReportedConflict_m = 0.05;

// Share of rejected tags above which a report is made, and below which the next one may follow.
constexpr double kLarge = 0.3;
constexpr double kSmallAgain = 0.15;
// Fewest tags in ten seconds.
constexpr int kFewest = 50;
constexpr Duration kSecond = std::chrono::seconds(1);
// Most of the seconds must have a large share.
constexpr double kBadSecond = 0.2;
constexpr int kBadSeconds = 7;

double share_of(int rejected, int used) {
  return static_cast<double>(rejected) / std::max(1, rejected + used);
}

}  // namespace

std::optional<UpGuess> guess_up(std::span<const TagBelief> tags) {
  std::vector<Ways> all;
  for (const TagBelief& tag : tags)
    if (tag.sightings >= kSightingsToVote) all.push_back(ways_of(tag));
  const int count = static_cast<int>(all.size());
  if (count < kFewestVoters) return std::nullopt;
  const auto votes = [&](const Eigen::Vector3d& up) {
    return static_cast<int>(
        std::ranges::count_if(all, [&](const Ways& w) { return agrees(w, up); }));
  };
  UpGuess best{Eigen::Vector3d::UnitZ(), 0, count};
  for (const Ways& ways : all)
    for (const Eigen::Vector3d& up : ways)
      if (const int agree = votes(up); agree > best.agree) best = {up, agree, count};
  int next = 0;
  for (const Ways& ways : all)
    for (const Eigen::Vector3d& up : ways)
      if (up.dot(best.up_W) < kOtherWay) next = std::max(next, votes(up));
  if (best.agree < kMajority * count || next > kNextAtMost * best.agree) return std::nullopt;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Ways& ways : all)
    for (const Eigen::Vector3d& up : ways)
      if (up.dot(best.up_W) > kSameWay) sum += up;
  best.up_W = sum.normalized();
  return best;
}

std::string UpCheck::add(Instant at, const std::optional<BodyEstimate>& estimate,
                         std::span<const TagBelief> own, std::span<const KnownTag> known) {
  if (is_over_) return {};
  if (!is_guess_reported_) {
    if (!known.empty()) {
      is_over_ = true;  // by the map
      return {};
    }
    if (!estimate || !estimate->anchored) return wait_for_floor(at, own);
    if (gauge_.stands_by_floor()) {
      is_over_ = true;
      return {};
    }
    is_guess_reported_ = true;
    return "without an IMU the vertical is unknown: z of the workspace is the normal of the first "
           "tag, which is right only if that tag lies on the floor. " +
           up_remedy();
  }
  if (guessed_at_ && at - *guessed_at_ < kGuessPeriod) return {};
  guessed_at_ = at;
  const auto guess = guess_up(own);
  if (!guess) return {};
  is_over_ = true;
  return guess_text(*guess);
}

std::string UpCheck::wait_for_floor(Instant at, std::span<const TagBelief> own) {
  if (!gauge_.stands_by_floor() || is_wait_reported_ || own.empty()) return {};
  if (!waits_since_) waits_since_ = at;
  if (at - *waits_since_ < kFloorReportedAfter) return {};
  is_wait_reported_ = true;
  std::string missing;
  for (const int tag_id : gauge_.floor_tags) {
    const bool is_known = std::ranges::any_of(own, [&](const TagBelief& belief) {
      return belief.tag.tag_id == tag_id && belief.sightings >= kSightingsToVote;
    });
    if (!is_known) missing += fmt::format("{}{}", missing.empty() ? "" : ", ", tag_id);
  }
  if (missing.empty())
    return "no pose yet: the tags of map.floor_tags do not face the same way, or the reference tag "
           "was not seen. Do they lie flat, face up?";
  return fmt::format(
      "no pose yet: without an IMU the tags of map.floor_tags define the vertical, and of them {} "
      "was not seen well. Show it to the camera together with tags seen before, or remove it from "
      "the list",
      missing);
}

std::string rejection_text(double share, bool has_imu) {
  return fmt::format(
      "{:.0f} % of the tags seen within ten seconds contradicted the rest. Check, in this order: "
      "printed sizes (tags.size_m, tags.sizes_m); the camera's calibration (lens, resolution){}; "
      "tags that move or exist twice",
      kPercent * share, has_imu ? "; the pose of the camera on the IMU; the clocks" : "");
}

std::optional<double> RejectionWatch::add(const UpdateReport& report) {
  if (!begun_at_) begun_at_ = report.exposed_at;
  const Duration since = report.exposed_at - *begun_at_;
  std::optional<double> finding;
  if (since >= kSecond || since < Duration{0}) {
    begun_at_ = report.exposed_at;
    seconds_[full_++ % kSeconds] = now_;
    now_ = {};
    finding = judge();
  }
  now_.used += report.tags_used;
  now_.rejected += report.tags_rejected;
  return finding;
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
  if (share < kSmallAgain) reported_ = false;
  if (reported_ || bad < kBadSeconds || share < kLarge || sum.used + sum.rejected < kFewest)
    return std::nullopt;
  reported_ = true;
  return share;
}

std::string TagDoubts::add(const TagObservations& seen, const UpdateReport& report,
                           const std::optional<BodyEstimate>& estimate,
                           std::span<const TagBelief> own, std::span<const KnownTag> known) {
  std::string text;
  const auto append = [&](const std::string& more) {
    if (!more.empty()) text += (text.empty() ? "" : "; ") + more;
  };
  if (const auto share = rejections_.add(report)) append(rejection_text(*share, has_imu_));
  append(up_.add(seen.exposed_at, estimate, own, known));
  append(branch_text(report, estimate.has_value()));
  append(conflict_text(report));
  if (text.empty()) return text;
  const std::lock_guard lock(mutex_);
  if (texts_.size() < kMostTexts) texts_.push_back(text);
  return text;
}

/// Without an IMU a body waits until the branch of a tag's two poses is decided.
std::string TagDoubts::branch_text(const UpdateReport& report, bool has_pose) {
  if (has_imu_ || has_pose) {
    waits_since_.reset();
    is_wait_reported_ = false;
    return {};
  }
  if (report.tags_pending == 0 || is_wait_reported_) return {};
  if (!waits_since_) waits_since_ = report.exposed_at;
  if (report.exposed_at - *waits_since_ < kBranchReportedAfter) return {};
  is_wait_reported_ = true;
  return "no pose: the tags in view are so small that their corners allow two poses, and there is "
         "no IMU to decide. Come nearer, view them at an angle, or show more known tags";
}

/// Known tags disagree about the body's pose, and no other tag decides.
std::string TagDoubts::conflict_text(const UpdateReport& report) {
  if (!report.ambiguous_place) {
    conflict_since_.reset();
    is_conflict_reported_ = false;
    return {};
  }
  if (!conflict_since_) conflict_since_ = report.exposed_at;
  if (is_conflict_reported_ || report.ambiguous_place->by_m < kReportedConflict_m) return {};
  if (report.exposed_at - *conflict_since_ < kConflictReportedAfter) return {};
  is_conflict_reported_ = true;
  return fmt::format(
      "by tag {} the body is {:.2f} m from its estimated position: the tag was moved, or the "
      "estimate is wrong. Until another known tag decides, the pose is uncertain by that",
      report.ambiguous_place->tag_id, report.ambiguous_place->by_m);
}

std::vector<std::string> TagDoubts::texts() const {
  const std::lock_guard lock(mutex_);
  return texts_;
}

}  // namespace fiducap
