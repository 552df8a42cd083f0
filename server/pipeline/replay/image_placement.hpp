#pragma once

#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "base/pose.hpp"
#include "capture/recording/odometry.hpp"
#include "estimation/estimator_config.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "estimation/start/place_search.hpp"
#include "pipeline/replay/image_log.hpp"

namespace fiducap {

/// One body's images, with the present noise and cameras.
struct BodyToPlace {
  const ImageLog* log{};
  std::vector<CameraMount> cameras;  ///< As configured: corners were undistorted by them.
  std::vector<CameraBelief> beliefs;
  const Odometry* odometry{};   ///< nullptr: none.
  double corner_noise_px{0.4};  ///< Where the detector gives none.
};

/// Initial poses of bodies without IMU, and of tags, image by image, for a least-squares problem to
/// converge to the correct minimum.
///
/// A planar tag allows two poses. An instant is placed by the proposals of its tags (the filter's
/// pose then, both poses of the largest tags), improved by least squares over all its corners; the
/// cheapest is chosen, and it is sure when all others cost much more. A tag gets the pose that
/// explains its sightings at sure instants, if no other branch does nearly as well. Both alternate
/// until nothing more is placed. Then a new region begins by a rough survey, by a map in other
/// axes, or by two tags that are often seen together; images with tags of two regions join them.
/// Odometry places instants without placed tags.
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
    bool is_sure{};  ///< No other pose explains it nearly as well.
  };

  explicit ImagePlacement(std::vector<BodyToPlace> bodies);
  /// A given pose, never changed.
  void hold(const KnownTag& tag);
  /// A probable pose. @param component  0: in the workspace
  void suggest(int component, const KnownTag& tag);
  /// A pose by survey, decimetres off.
  void survey(const KnownTag& tag) { surveyed_.emplace(tag.tag_id, tag); }
  /// A solution: used unless something else fits much better.
  void take(std::size_t body, const std::vector<CameraBelief>& cameras,
            std::span<const StampedPose> poses);
  void take(const KnownTag& tag);

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
  [[nodiscard]] const std::vector<CameraBelief>& cameras(std::size_t body) const {
    return bodies_[body].beliefs;
  }

 private:
  struct Sighting {
    std::size_t body{};
    std::size_t instant{};
    std::size_t image{};
    const TagObservation* seen{};
  };
  struct View {
    std::size_t body{};
    std::size_t instant{};
  };
  struct Choice {
    Pose X;
    double cost{};
    bool is_sure{};
  };
  void look_through(std::size_t body);
  [[nodiscard]] std::vector<PlaceProposal> proposals(std::size_t body, std::size_t instant,
                                                     int region) const;
  [[nodiscard]] bool is_in(int tag_id, int region) const;
  [[nodiscard]] std::vector<SightedTag> sighted(std::size_t body, std::size_t instant,
                                                int region) const;
  [[nodiscard]] int region_of(std::size_t body, std::size_t instant) const;
  bool place_instant(std::size_t body, std::size_t instant);
  [[nodiscard]] double jump(std::size_t body, std::size_t instant, const Pose& X_WB) const;
  bool place_tag(int tag_id);
  [[nodiscard]] std::vector<Sighting> usable(int tag_id, int region) const;
  [[nodiscard]] std::optional<Choice> best_place(const std::vector<Sighting>& sightings,
                                                 const std::optional<Pose>& now) const;
  [[nodiscard]] double cost_of(const std::vector<Sighting>& sightings, const Pose& X_WT) const;
  bool place_instants(bool all);
  bool grow();
  bool follow_odometry(std::size_t body);
  bool carry(std::size_t body, std::size_t from, std::size_t to);
  bool begin_by_odometry();
  bool begin_elsewhere();
  bool begin_with_two();
  bool begin_with_one();
  bool join_regions();
  [[nodiscard]] std::vector<CostedPose> ways_at(const View& view,
                                                const std::vector<SightedTag>& tags) const;
  [[nodiscard]] CostedPose best_at(const View& view, const std::vector<SightedTag>& tags) const;
  [[nodiscard]] std::vector<SightedTag> sighted_of(const View& view, int tag_id,
                                                   const Pose& X_AT) const;
  [[nodiscard]] std::optional<Pose> between(int first, int second,
                                            const std::vector<View>& views) const;
  [[nodiscard]] std::optional<Pose> over(int region, const std::vector<View>& views) const;
  void put(const KnownTag& tag, int region, bool is_held);

  std::vector<BodyToPlace> bodies_;
  std::vector<std::vector<std::vector<TagObservations>>> seen_;  ///< By body and instant.
  std::vector<std::vector<CameraMount>> cameras_;                ///< Present estimates.
  std::vector<std::vector<Placed>> placed_;
  std::vector<std::vector<bool>> waits_;  ///< Sees a tag that has been placed since.
  std::map<int, std::vector<Sighting>> sightings_;
  std::map<int, Tag> tags_;
  std::map<int, std::map<int, KnownTag>> suggested_;  ///< By component, not yet used.
  std::map<int, KnownTag> surveyed_;
  int regions_{1};
  /// Pairs of tags that gave no relative pose, and by how many images.
  std::set<std::pair<std::pair<int, int>, std::size_t>> were_tried_;
  bool is_by_odometry_{false};  ///< The workspace has the axes of a body's odometry.
};

}  // namespace fiducap
