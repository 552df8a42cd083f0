#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "estimation/filter/tag_measurement.hpp"

namespace fiducap {

/// Rejected sightings of each tag by id, and how often the tag was removed. The newest ids.
class TagHealth final {
 public:
  /// Consecutive rejections that are no chance. The gate rejects one of a thousand right sightings,
  /// and errors last for some five images: ten of them outweigh a prior of 1e-6.
  static constexpr int kToDecide = 10;
  /// Consecutive rejections after which the places of the body are compared.
  static constexpr int kToDoubt = 3;

  void note_sighting(int tag_id, bool is_accepted);
  /// @return consecutive rejections
  [[nodiscard]] int rejected(int tag_id) const;
  /// The rejections had another cause.
  void reset_rejections();
  void forget_all() { records_.clear(); }

  /// The tag was removed. From the second time on (a door, an id used twice; a tag is moved once)
  /// it is excluded, each time twice as long.
  void note_removal(int tag_id, Instant at);
  [[nodiscard]] bool was_removed(int tag_id, Instant since) const;
  /// The tag must not be used for now.
  [[nodiscard]] bool is_excluded(int tag_id, Instant now) const;

 private:
  struct Record {
    int tag_id{};
    int rejected{0};  ///< Consecutive.
    int removals{0};
    Instant removed_at{};
  };
  [[nodiscard]] const Record* find(int tag_id) const;
  Record& record(int tag_id);

  std::vector<Record> records_;
};

/// Counts images that contradict the filter, and rejections of each tag.
class Contradictions final {
 public:
  /// Adds the result of an update.
  void count(int camera, Instant exposed_at, std::span<const TagToUse> used,
             const std::vector<bool>& accepted);
  /// The pose was confirmed at this time.
  void note_fit(Instant at) { last_fit_ = at; }
  /// Resets all counts when the contradictions had another cause (the motion or a clock).
  void reset();
  void forget_all() { *this = Contradictions{}; }

  /// Consecutive images with usable tags and none accepted.
  [[nodiscard]] int images_without_fit() const { return images_without_fit_; }
  /// Consecutive images with at least half of the tags rejected.
  [[nodiscard]] int contradicting_images() const { return contradicting_images_; }
  /// The same of one camera.
  [[nodiscard]] int contradicting_images_of(int camera) const {
    const auto k = static_cast<std::size_t>(camera);
    return k < contradicting_of_.size() ? contradicting_of_[k] : 0;
  }
  [[nodiscard]] double seconds_without_fit(Instant now) const {
    return last_fit_ ? to_seconds(now - *last_fit_) : 0.0;
  }
  [[nodiscard]] TagHealth& tags() { return tags_; }
  [[nodiscard]] const TagHealth& tags() const { return tags_; }

 private:
  TagHealth tags_;
  std::optional<Instant> last_fit_;
  int images_without_fit_{0};
  int contradicting_images_{0};
  std::vector<int> contradicting_of_;  ///< Per camera.
};

/// The estimate of the body's place, and the likeliest other place that explains the sightings.
///
/// A proven tag gives a position of the body. Each tag is in place, or was moved (probability
/// kMoved, by kMovedBy_m); the motion since the last fit is as the IMU measured it, or not
/// (kImuWrong, by as much). The places that compete are the estimate, where its accepted tags are
/// in place; the place by each rejected tag, where the accepted ones were moved; and the place by
/// the IMU alone, where all accepted ones were moved. The probability of each is the marginal
/// likelihood of all positions, by one Kalman update per tag. A tag counts once, with the mean of
/// its sightings: their errors are common. Positions are relative to the estimate, W axes.
class PlaceDoubt final {
 public:
  static constexpr double kByOneTag_m = 0.05;  ///< 1-sigma per axis of a position by a few images.
  static constexpr double kMoved = 0.2;        ///< Of tags that contradict or return after a gap.
  static constexpr double kMovedBy_m = 0.5;    ///< 1-sigma per axis: across a table, along a wall.
  static constexpr double kImuWrong = 0.05;    ///< Bodies are wrong less often than tags are moved.

  [[nodiscard]] bool is_open() const { return opened_at_.has_value(); }
  [[nodiscard]] const std::optional<Instant>& opened_at() const { return opened_at_; }
  void close() { *this = PlaceDoubt{}; }
  /// @param by_imu_W  place by the IMU alone
  /// @param S         its covariance
  void open(Instant at, const Eigen::Vector3d& by_imu_W, const Eigen::Matrix3d& S);

  /// Adds a sighting of a proven tag. The first kMostTags ids count.
  /// @param position_W  of the body by this tag; nullopt: the estimate (the tag was accepted)
  void add(int tag_id, const std::optional<Eigen::Vector3d>& position_W);
  /// Compares the places again, after all sightings of an image.
  void weigh();
  /// The body is at the other place: that is the estimate from now on.
  void change_place();
  /// The estimate was moved.
  void move(Eigen::Vector3d by_W);  // a copy: may be other_W_
  /// The IMU's place is less certain than when it was given.
  void grow(const Eigen::Matrix3d& S) {
    if (S.trace() > S_.trace()) S_ = S;
  }
  /// The axes were turned. (A shift of them does not change relative positions.)
  void turn(const Eigen::Quaterniond& q_new_old);

  /// Log odds of the other place.
  [[nodiscard]] double log_odds() const { return log_odds_; }
  [[nodiscard]] double probability() const;
  [[nodiscard]] const Eigen::Vector3d& other_place_W() const { return other_W_; }
  /// What the second moment about the estimate, of the mixture of both places, has beyond the
  /// covariance of the estimate.
  [[nodiscard]] Eigen::Matrix3d covariance() const;
  /// The rejected tag nearest to the other place; -1: none.
  [[nodiscard]] int contradicting_tag() const;
  /// The position of the body by this tag moves: the tag was not moved once. The error of single
  /// tags is common to both means.
  [[nodiscard]] bool drifts(int tag_id) const {
    const Tag* const tag = find(tag_id);
    return tag != nullptr && (tag->newest_W - tag->position_W).norm() > kByOneTag_m;
  }
  [[nodiscard]] bool contradicts(int tag_id) const {
    const Tag* const tag = find(tag_id);
    return tag != nullptr && !tag->is_accepted;
  }

 private:
  static constexpr std::size_t kMostTags = 8;

  struct Tag {
    int tag_id{-1};
    bool is_accepted{};  ///< By its newest sighting.
    int sightings{};
    Eigen::Vector3d position_W{Eigen::Vector3d::Zero()};  ///< Mean.
    Eigen::Vector3d newest_W{Eigen::Vector3d::Zero()};    ///< Mean of the last few.
  };
  struct Place {
    Eigen::Vector3d p_W{Eigen::Vector3d::Zero()};
    Eigen::Matrix3d covariance{Eigen::Matrix3d::Zero()};
    double log_likelihood{};
  };
  [[nodiscard]] const Tag* find(int tag_id) const;
  [[nodiscard]] bool has_accepted() const;
  /// @param in_place     rejected tag that is in place; nullptr: none has to be
  /// @param is_estimate  accepted tags are in place; else they were moved
  [[nodiscard]] Place place(const Tag* in_place, bool is_estimate) const;
  void take(const Tag& tag, std::optional<bool> is_in_place, Place& place) const;

  std::optional<Instant> opened_at_;
  Eigen::Vector3d by_imu_W_{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d S_{Eigen::Matrix3d::Identity()};
  std::array<Tag, kMostTags> tags_{};
  std::size_t count_{0};
  double log_odds_{};
  Eigen::Vector3d other_W_{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d other_covariance_{Eigen::Matrix3d::Zero()};
};

}  // namespace fiducap
