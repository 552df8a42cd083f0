#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/filter/tag_measurement.hpp"

namespace fiducap {

/// Counts rejections of each tag by id, to find tags that were moved or misread.
///
/// An update that accepts no tag does not remove any: the filter itself may be wrong. If all of
/// these rejected the same tag and then another tag is accepted, that one was wrong.
class TagScores final {
 public:
  /// Images that rejected a tag and accepted no other, before the tag is doubtful.
  static constexpr int kToDoubt = 3;
  static constexpr int kToDrop = 10;  ///< Consecutive rejections before a tag is removed.

  /// @param accepted  per entry of `used`
  /// @return ids of the tags to remove with this image; their counts are reset
  std::span<const int> count(std::span<const TagToUse> used, const std::vector<bool>& accepted);
  void clear() { scores_.clear(); }
  /// Either the tag or the filter is wrong.
  [[nodiscard]] bool is_doubtful(int tag_id) const;
  [[nodiscard]] int doubtful() const;

 private:
  /// Of a tag that was rejected at its last sighting.
  struct Score {
    int tag_id{};
    int rejected_in_row{};  ///< By images that accepted other tags.
    int rejected_alone{};   ///< By images that accepted none, since one last did.
  };

  std::vector<Score> scores_;
  std::vector<int> removed_;
};

/// Counts images that contradict the filter, and rejections of each tag.
class Contradictions final {
 public:
  /// Adds the result of an update.
  /// @return ids of the tags to remove
  std::span<const int> count(int camera, Instant exposed_at, std::span<const TagToUse> used,
                             const std::vector<bool>& accepted);
  /// The pose was confirmed at this time.
  void note_fit(Instant at) { last_fit_ = at; }
  /// Resets all counts when the contradictions had another cause (the motion or a clock).
  void reset();
  /// Resets the counts of tags alone.
  void reset_tag_scores() { scores_.clear(); }
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
  [[nodiscard]] bool has_ever_fit() const { return last_fit_.has_value(); }
  [[nodiscard]] const TagScores& scores() const { return scores_; }

 private:
  TagScores scores_;
  std::optional<Instant> last_fit_;
  int images_without_fit_{0};
  int contradicting_images_{0};
  std::vector<int> contradicting_of_;  ///< Per camera.
};

struct RemovedTag {
  int tag_id{};
  bool was_proven{};
};

/// Tags that were removed repeatedly (attached to something that moves, or an id used twice) are
/// excluded with exponential back-off. Remembers the newest ids.
class UnstableTags final {
 public:
  void note_removal(int tag_id, Instant at);
  /// The tag must not be used for now.
  [[nodiscard]] bool is_excluded(int tag_id, Instant now) const;
  void forget_all() { *this = UnstableTags{}; }

 private:
  struct Removal {
    int tag_id{-1};
    int times{0};
    Instant last{};
  };
  std::array<Removal, 64> tags_{};
  std::size_t next_{0};  ///< Overwritten by the next new id.
};

/// Monitors a relocalisation by a single tag, which may have been moved during the gap: the pose is
/// a mixture of "the tag is in place" and "it was moved, and the IMU is right". When proven tags
/// contradict it, the less likely motion by the IMU decides which of them was moved.
class SingleTagRelocalisation final {
 public:
  enum class Verdict { kOpen, kTagWrong, kOthersWrong };

  /// @param before  nullopt: the body was lost
  void begin(int tag_id, const std::optional<BodyPlace>& before, const Eigen::Vector3d& p_WB_now);
  void forget() { *this = SingleTagRelocalisation{}; }
  [[nodiscard]] bool is_watched() const { return tag_id_.has_value(); }
  [[nodiscard]] int tag_id() const { return *tag_id_; }
  /// Covariance of the position that the mixture has beyond that of the filter, W axes.
  [[nodiscard]] const Eigen::Matrix3d& mixture() const { return mixture_; }
  /// Adds an image whose proven tags contradict. Two different ones outvote the single tag.
  /// @param against  their ids, at least one
  /// @param shift_W  position of the body by the first of them, relative to the estimate; nullopt:
  ///                 not known
  [[nodiscard]] Verdict contradict(std::span<const int> against,
                                   const std::optional<Eigen::Vector3d>& shift_W);

 private:
  std::optional<int> tag_id_;
  std::optional<BodyPlace> before_;
  Eigen::Vector3d moved_W_{Eigen::Vector3d::Zero()};  ///< Motion of the body by the single tag.
  Eigen::Matrix3d mixture_{Eigen::Matrix3d::Zero()};
  int images_against_{0};
  std::optional<int> against_;                         ///< The tag that contradicts.
  bool are_several_{false};                            ///< Others contradict, too.
  Eigen::Vector3d shifts_W_{Eigen::Vector3d::Zero()};  ///< Sum of all `shift_W`.
  int shifts_{0};
};

}  // namespace fiducap
