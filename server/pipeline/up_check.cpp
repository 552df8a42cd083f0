#include "pipeline/up_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace fiducap {

namespace {

constexpr double kDegreesOfRad = 180 / std::numbers::pi;
// A tag seen less often may still be anywhere.
constexpr int kSightingsToVote = 20;
constexpr int kFewestVoters = 3;
// A direction wins with so many of the tags, when the next one has at most so many of its votes.
// In a box of three walls every horizontal direction is said by two tags, and up by all three.
constexpr double kMajority = 0.8;
constexpr double kNextAtMost = 0.8;
// Prints hang crooked by this much …
const double kSameWay = std::cos(10 / kDegreesOfRad);
// … and a direction further off is another one.
const double kOtherWay = std::cos(25 / kDegreesOfRad);
constexpr Duration kGuessPeriod = std::chrono::seconds(1);
constexpr Duration kPatienceWithFloor = std::chrono::seconds(10);

using Ways = std::array<Eigen::Vector3d, 3>;

/// Where up is when it hangs on a wall, lies on the floor, or looks down from the ceiling.
Ways ways_of(const TagBelief& tag) {
  const Eigen::Matrix3d R = tag.tag.X_WT.rotation();
  return {R.col(1), R.col(2), -R.col(2)};
}

bool says(const Ways& ways, const Eigen::Vector3d& up) {
  return std::any_of(ways.begin(), ways.end(), [&](const auto& w) { return w.dot(up) > kSameWay; });
}

std::string up_remedy() {
  return "Name tags that lie flat on the floor, face up (map.floor_tags), or measure the first "
         "tag's place (map.reference_tag with map.reference_pose)";
}

std::string axis_name(const Eigen::Vector3d& up) {
  int axis = 0;
  (void)up.cwiseAbs().maxCoeff(&axis);
  return fmt::format("{}{}", up(axis) > 0 ? '+' : '-', "xyz"[axis]);
}

std::string guess_text(const UpGuess& guess) {
  const double angle = kDegreesOfRad * std::acos(std::clamp(guess.up_W.z(), -1.0, 1.0));
  if (guess.up_W.z() > kOtherWay)
    return fmt::format(
        "what is up is guessed, but {} of {} tags agree with it (to {:.0f} deg): they hang "
        "upright, "
        "or lie flat",
        guess.agree, guess.of, angle);
  return fmt::format(
      "the workspace seems to lie on its side: by how {} of {} tags hang, up is {:.0f} deg from "
      "its "
      "z axis, about along {}. Nothing is turned, for poses were given out. {}, forget this map, "
      "and start again",
      guess.agree, guess.of, angle, axis_name(guess.up_W), up_remedy());
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
        std::count_if(all.begin(), all.end(), [&](const Ways& w) { return says(w, up); }));
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
  if (!is_guess_told_) {
    if (!known.empty()) {
      is_over_ = true;  // the map says what is up
      return {};
    }
    if (!estimate || !estimate->anchored) return wait_for_floor(at, own);
    if (gauge_.stands_by_floor()) {
      is_over_ = true;
      return {};
    }
    is_guess_told_ = true;
    return "without an IMU nothing says what is up: z of the workspace is the way the first tag "
           "looks, which is a guess, and right if that tag lies on the floor. " +
           up_remedy();
  }
  if (looked_at_ && at - *looked_at_ < kGuessPeriod) return {};
  looked_at_ = at;
  const auto guess = guess_up(own);
  if (!guess) return {};
  is_over_ = true;
  return guess_text(*guess);
}

std::string UpCheck::wait_for_floor(Instant at, std::span<const TagBelief> own) {
  if (!gauge_.stands_by_floor() || is_wait_told_ || own.empty()) return {};
  if (!waits_since_) waits_since_ = at;
  if (at - *waits_since_ < kPatienceWithFloor) return {};
  is_wait_told_ = true;
  std::string missing;
  for (const int tag_id : gauge_.floor_tags) {
    const bool is_known = std::any_of(own.begin(), own.end(), [&](const TagBelief& belief) {
      return belief.tag.tag_id == tag_id && belief.sightings >= kSightingsToVote;
    });
    if (!is_known) missing += fmt::format("{}{}", missing.empty() ? "" : ", ", tag_id);
  }
  if (missing.empty())
    return "no pose yet: the tags of map.floor_tags do not look the same way, or the reference tag "
           "was not seen. Do they lie flat, face up?";
  return fmt::format(
      "no pose yet: without an IMU the tags of map.floor_tags say what is up, and of them {} was "
      "not seen well. Show it to the camera, together with tags seen before, or take it out",
      missing);
}

}  // namespace fiducap
