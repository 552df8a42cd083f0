#include "estimation/update/contradictions.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace fiducap {

namespace {
constexpr std::size_t kMostRecords = 256;  // a bound of the memory
// Exclusion after the second removal; at most 64 times as long.
constexpr Duration kFirstPause = std::chrono::seconds(20);
constexpr int kMostDoublings = 6;
constexpr Duration kForgotten = std::chrono::minutes(30);  // age of a removal that does not count

constexpr double kImpossible = -1e9;  // log likelihood

Eigen::Matrix3d even(double sigma_m) { return sigma_m * sigma_m * Eigen::Matrix3d::Identity(); }

/// Of N(0, S), without the factor common to all.
double log_density(const Eigen::Vector3d& x, const Eigen::Matrix3d& S) {
  const Eigen::LLT<Eigen::Matrix3d> factor(S);
  const double log_root = factor.matrixLLT().diagonal().array().log().sum();
  return -0.5 * x.dot(factor.solve(x)) - log_root;
}

}  // namespace

const TagHealth::Record* TagHealth::find(int tag_id) const {
  const auto found = std::ranges::find(records_, tag_id, &Record::tag_id);
  return found == records_.end() ? nullptr : &*found;
}

TagHealth::Record& TagHealth::record(int tag_id) {
  const auto found = std::ranges::find(records_, tag_id, &Record::tag_id);
  if (found != records_.end()) return *found;
  if (records_.size() >= kMostRecords) records_.erase(records_.begin());
  return records_.emplace_back(Record{.tag_id = tag_id});
}

void TagHealth::note_sighting(int tag_id, bool is_accepted) {
  if (!is_accepted) {
    ++record(tag_id).rejected;
  } else if (find(tag_id) != nullptr) {
    record(tag_id).rejected = 0;
  }
}

int TagHealth::rejected(int tag_id) const {
  const Record* const known = find(tag_id);
  return known == nullptr ? 0 : known->rejected;
}

void TagHealth::reset_rejections() {
  for (Record& one : records_) one.rejected = 0;
}

void TagHealth::note_removal(int tag_id, Instant at) {
  Record& one = record(tag_id);
  if (at - one.removed_at > kForgotten) one.removals = 0;
  one.rejected = 0;
  ++one.removals;
  one.removed_at = at;
}

bool TagHealth::was_removed(int tag_id, Instant since) const {
  const Record* const known = find(tag_id);
  return known != nullptr && known->removals > 0 && known->removed_at >= since;
}

bool TagHealth::is_excluded(int tag_id, Instant now) const {
  const Record* const known = find(tag_id);
  if (known == nullptr || known->removals < 2) return false;
  const int doublings = std::min(known->removals - 2, kMostDoublings);
  return now - known->removed_at < kFirstPause * (1 << doublings);
}

void Contradictions::count(int camera, Instant exposed_at, std::span<const TagToUse> used,
                           const std::vector<bool>& accepted) {
  const auto fit = std::count(accepted.begin(), accepted.end(), true);
  images_without_fit_ = fit > 0 ? 0 : images_without_fit_ + 1;
  const bool contradicts = 2 * fit <= static_cast<std::ptrdiff_t>(used.size());
  const auto k = static_cast<std::size_t>(camera);
  if (k >= contradicting_of_.size()) contradicting_of_.resize(k + 1, 0);
  for (int* const images : {&contradicting_images_, &contradicting_of_[k]})
    *images = contradicts ? *images + 1 : 0;
  if (fit > 0) last_fit_ = exposed_at;
  for (std::size_t i = 0; i < used.size(); ++i)
    tags_.note_sighting(used[i].seen->tag_id, accepted[i]);
}

void Contradictions::reset() {
  tags_.reset_rejections();
  images_without_fit_ = 0;
  contradicting_images_ = 0;
  std::ranges::fill(contradicting_of_, 0);
}

void PlaceDoubt::open(Instant at, const Eigen::Vector3d& by_imu_W, const Eigen::Matrix3d& S) {
  close();
  opened_at_ = at;
  by_imu_W_ = by_imu_W;
  S_ = S;
}

bool PlaceDoubt::has_accepted() const {
  return std::any_of(tags_.begin(), tags_.begin() + static_cast<std::ptrdiff_t>(count_),
                     [](const Tag& tag) { return tag.is_accepted; });
}

const PlaceDoubt::Tag* PlaceDoubt::find(int tag_id) const {
  const auto end = tags_.begin() + static_cast<std::ptrdiff_t>(count_);
  const auto found =
      std::find_if(tags_.begin(), end, [&](const Tag& tag) { return tag.tag_id == tag_id; });
  return found == end ? nullptr : &*found;
}

int PlaceDoubt::contradicting_tag() const {
  const Tag* nearest = nullptr;
  const auto off_m = [&](const Tag& tag) { return (tag.position_W - other_W_).norm(); };
  for (std::size_t i = 0; i < count_; ++i)
    if (!tags_[i].is_accepted && (nearest == nullptr || off_m(tags_[i]) < off_m(*nearest)))
      nearest = &tags_[i];
  return nearest == nullptr ? -1 : nearest->tag_id;
}

void PlaceDoubt::add(int tag_id, const std::optional<Eigen::Vector3d>& position_W) {
  const Tag* known = find(tag_id);
  if (known == nullptr && count_ == kMostTags) {  // a tag that contradicts replaces another
    known = std::ranges::find(tags_, true, &Tag::is_accepted);
    if (!position_W || known == tags_.end()) return;
  }
  Tag& tag =
      known == nullptr ? tags_[count_++] : tags_[static_cast<std::size_t>(known - &tags_[0])];
  const bool is_accepted = !position_W.has_value();
  // Otherwise the map or the estimate has changed.
  if (tag.tag_id != tag_id || tag.is_accepted != is_accepted) tag.sightings = 0;
  tag.tag_id = tag_id;
  tag.is_accepted = is_accepted;
  constexpr int kLastFew = 5;
  const Eigen::Vector3d p_W = position_W.value_or(Eigen::Vector3d::Zero());
  tag.position_W += (p_W - tag.position_W) / ++tag.sightings;
  tag.newest_W += (p_W - tag.newest_W) / std::min(tag.sightings, kLastFew);
}

/// @param is_in_place  nullopt: whichever is likelier
void PlaceDoubt::take(const Tag& tag, std::optional<bool> is_in_place, Place& place) const {
  const Eigen::Vector3d y = tag.position_W - place.p_W;
  const Eigen::Matrix3d S_in_place = place.covariance + even(kByOneTag_m);
  const Eigen::Matrix3d S_moved = place.covariance + even(kMovedBy_m);
  const double in_place = std::log(1 - kMoved) + log_density(y, S_in_place);
  const double moved = std::log(kMoved) + log_density(y, S_moved);
  const bool stands = is_in_place.value_or(in_place > moved);
  place.log_likelihood += stands ? in_place : moved;
  const Eigen::Matrix3d K =
      (stands ? S_in_place : S_moved).llt().solve(place.covariance).transpose();
  place.p_W += K * y;
  place.covariance -= (K * place.covariance).eval();
}

PlaceDoubt::Place PlaceDoubt::place(const Tag* in_place, bool is_estimate) const {
  const bool is_by_imu = in_place == nullptr && (!is_estimate || !has_accepted());
  Place best{.log_likelihood = kImpossible};
  for (const bool is_imu_wrong : {false, true}) {
    if (is_imu_wrong && is_by_imu) continue;
    // Tags that contradict the IMU alone do so by the gate, which is finer than these positions.
    if (!is_imu_wrong && !is_estimate && !has_accepted()) continue;
    Place one{by_imu_W_, S_, std::log(is_imu_wrong ? kImuWrong : 1 - kImuWrong)};
    if (is_imu_wrong) one.covariance += even(kMovedBy_m);
    if (in_place != nullptr) take(*in_place, true, one);
    for (std::size_t i = 0; i < count_; ++i)
      if (tags_[i].is_accepted) take(tags_[i], is_estimate, one);
    if (is_estimate) {  // the filter's own place
      one.p_W.setZero();
      one.covariance.setZero();
    }
    const auto is_in_place = is_estimate && is_by_imu ? std::optional(false) : std::nullopt;
    for (std::size_t i = 0; i < count_; ++i)
      if (!tags_[i].is_accepted && &tags_[i] != in_place) take(tags_[i], is_in_place, one);
    if (one.log_likelihood > best.log_likelihood) best = one;
  }
  return best;
}

void PlaceDoubt::weigh() {
  const Place estimate = place(nullptr, true);
  Place other{.log_likelihood = kImpossible};
  const auto consider = [&](const Tag* in_place) {
    const Place one = place(in_place, false);
    if (one.log_likelihood > other.log_likelihood) other = one;
  };
  for (std::size_t i = 0; i < count_; ++i)
    if (!tags_[i].is_accepted) consider(&tags_[i]);
  if (has_accepted()) consider(nullptr);
  log_odds_ = other.log_likelihood - estimate.log_likelihood;
  other_W_ = other.p_W;
  other_covariance_ = other.covariance;
}

void PlaceDoubt::change_place() {
  move(other_W_);
  for (Tag& tag : tags_)
    tag.is_accepted = !tag.is_accepted && tag.position_W.norm() < 3 * kByOneTag_m;
  weigh();
}

void PlaceDoubt::move(const Eigen::Vector3d by_W) {
  by_imu_W_ -= by_W;
  other_W_ -= by_W;
  for (Tag& tag : tags_) {
    tag.position_W -= by_W;
    tag.newest_W -= by_W;
  }
}

void PlaceDoubt::turn(const Eigen::Quaterniond& q_new_old) {
  by_imu_W_ = q_new_old * by_imu_W_;
  other_W_ = q_new_old * other_W_;
  for (Tag& tag : tags_) {
    tag.position_W = q_new_old * tag.position_W;
    tag.newest_W = q_new_old * tag.newest_W;
  }
}

double PlaceDoubt::probability() const { return is_open() ? 1 / (1 + std::exp(-log_odds_)) : 0.0; }

Eigen::Matrix3d PlaceDoubt::covariance() const {
  return probability() * (other_covariance_ + other_W_ * other_W_.transpose());
}

}  // namespace fiducap
