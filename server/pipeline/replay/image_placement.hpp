#pragma once

#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "base/pose.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "estimation/start/place_search.hpp"
#include "pipeline/replay/batch_solution.hpp"

namespace fiducap {

/// One body's images, with the present noise and cameras.
struct BodyToPlace {
  const ImageLog* log{};
  std::vector<CameraMount> cameras;  ///< Configured lenses, estimated extrinsics.
  const Odometry* odometry{};        ///< nullptr: none.
  double corner_noise_px{0.4};       ///< Where the detector gives none.
};

/// Initial poses of bodies without IMU, and of tags, image by image, for a least-squares problem to
/// converge to the correct minimum.
///
/// A planar tag allows two poses. An instant is placed by all its tags with a pose (find_place());
/// it is sure when all other poses cost much more. A tag gets the pose that explains the images
/// that see it, when no other does nearly as well (relate()). Both alternate until nothing more is
/// placed. Then a new region begins, with the axes of a tag that is often seen. Regions that an
/// image connects are joined. Odometry places instants without placed tags.
class ImagePlacement final {
 public:
  static constexpr int kNowhere = -1;
  struct Tag {
    KnownTag tag;
    int region{};    ///< Of its axes; 0: the workspace.
    bool is_held{};  ///< Its pose is given.
  };
  struct Placed {
    Instant at{};
    int region{kNowhere};
    Pose X_WB;
    bool is_sure{false};  ///< No other pose explains it nearly as well.
    bool waits{true};     ///< Sees a tag that has been placed since.
  };

  /// @param branch_evidence  chi-square by which all other poses of a tag must be worse
  ImagePlacement(std::vector<BodyToPlace> bodies, double branch_evidence);
  /// A pose in the workspace. @param is_held  given, never changed
  void put(const KnownTag& tag, bool is_held) { put(tag, 0, is_held); }
  /// A pose by survey, decimetres off.
  void survey(const KnownTag& tag) { surveyed_.emplace(tag.tag_id, tag); }
  /// A solution: used unless something else fits much better.
  void take(std::size_t body, const std::vector<CameraBelief>& cameras,
            std::span<const StampedPose> poses);
  void take(const KnownTag& tag) {
    const auto known = tags_.find(tag.tag_id);
    if (known != tags_.end() && known->second.region == 0) put(tag, known->second.is_held);
  }
  /// Corner noise of a body, 1-sigma of a coordinate, by the median of its residuals; used from now
  /// on.
  double learn_noise(std::size_t body);

  /// @return whether anything is in another minimum than before
  bool settle();
  /// Moves a workspace that began by odometry to its reference tag.
  void define_workspace(const WorkspaceGauge& gauge);

  /// In order of the body's log.
  [[nodiscard]] const std::vector<Placed>& placed(std::size_t body) const { return placed_[body]; }
  [[nodiscard]] const std::map<int, Tag>& tags() const { return tags_; }
  /// Number of regions; 0 is the workspace.
  [[nodiscard]] int regions() const { return regions_; }

 private:
  /// An instant of a body.
  struct View {
    std::size_t body{};
    std::size_t instant{};
  };
  struct Way {
    Pose X;
    double cost{};
    bool fits{};  ///< At least half of the sightings.
  };
  // Axes are those of a region, or of a single tag: alone(tag_id), its own inverse.
  static constexpr int alone(int tag_id) { return -2 - tag_id; }
  [[nodiscard]] const Placed& at(const View& view) const {
    return placed_[view.body][view.instant];
  }
  /// Region and pose of all instants and tags.
  [[nodiscard]] std::vector<std::pair<int, Pose>> minima() const {
    std::vector<std::pair<int, Pose>> all;
    for (const View& view : all_) all.emplace_back(at(view).region, at(view).X_WB);
    for (const auto& [tag_id, tag] : tags_) all.emplace_back(tag.region, tag.tag.X_WT);
    return all;
  }
  [[nodiscard]] std::vector<SightedTag> tags_at(const View& view, int axes) const;
  [[nodiscard]] int region_of(const View& view) const;
  [[nodiscard]] KnownTag tag_at(int tag_id, const Pose& X_WT) const {
    const auto seen = tags_at(sightings_.at(tag_id).front(), alone(tag_id));
    return {tag_id, seen.front().seen->edge_m, X_WT, Matrix6d::Zero()};
  }
  [[nodiscard]] PlaceGuess guess_of(const View& view, int region) const;
  void place(const View& view);
  void place_waiting() {
    for (const View& view : all_)
      if (at(view).waits) place(view);
  }
  bool follow_odometry(std::size_t body);
  bool place_tag(int tag_id);
  void grow();
  bool begin();
  /// Two regions that images connect become one.
  bool join() {
    for (int into = 0; into < regions_; ++into) {
      for (int region = into + 1; region < regions_; ++region) {
        const auto T = relate(into, region);
        if (T) move(region, into, *T);
        if (T) return true;
      }
    }
    return false;
  }
  void withdraw(int region);
  void move(int region, int into, const Pose& T);
  void put(const KnownTag& tag, int region, bool is_held);
  [[nodiscard]] std::optional<Pose> relate(int a, int b);
  [[nodiscard]] std::vector<Pose> bodies_at(const View& view, int axes) const;
  void judge(Way& way, int a, int b, const std::vector<View>& views, bool is_fixed) const;

  std::vector<BodyToPlace> bodies_;
  double branch_evidence_;
  std::vector<std::vector<Placed>> placed_;
  std::vector<View> all_;
  std::map<int, std::vector<View>> sightings_;  ///< By tag id.
  std::map<int, Tag> tags_;
  std::map<int, KnownTag> surveyed_;
  int regions_{1};
  std::set<int> begun_;  ///< Tags with which a region began since settle() was called.
  /// Axes that could not be related in this turn of grow(), and by how many instants.
  std::map<std::pair<int, int>, std::size_t> tried_;
  bool is_by_odometry_{false};  ///< The workspace has the axes of a body's odometry.
};

}  // namespace fiducap
