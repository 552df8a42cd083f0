#pragma once

#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "base/stamped_pose.hpp"
#include "capture/odometry.hpp"
#include "estimation/estimator_config.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "estimation/start/resection.hpp"
#include "pipeline/replay/image_log.hpp"
#include "pipeline/replay/placement_misfit.hpp"

namespace fiducap {

/// One body's images, with noise and cameras as they are known.
struct BodyToPlace {
  const ImageLog* log{};
  std::vector<CameraMount> cameras;  ///< By configuration: corners were undistorted by them.
  std::vector<CameraBelief> beliefs;
  const Odometry* odometry{};   ///< nullptr: nobody knows how it moves.
  double corner_noise_px{0.4};  ///< Where the detector does not say how sure it is.
};

/// Where bodies without IMU, and tags, are, found image by image: what a least squares problem
/// begins with, so that it ends in the right valley.
///
/// A planar tag allows two poses. Each instant is placed by what its tags propose (the filter's
/// pose then, both poses of the largest tags), improved by least squares over all its corners; the
/// cheapest counts, and it is sure when the next one costs much more. A tag without a place gets
/// the one that explains its sightings at sure instants best, when another branch does not nearly
/// as well. So it goes on, in turns, until nothing more finds its place. Then a rough survey, or
/// what was known in other axes, begins where nothing else does, or two tags that are often seen
/// together; images that show such tags and others join them. Odometry gives places to instants
/// that see nothing that has one.
class ImagePlacement final {
 public:
  static constexpr int kNowhere = -1;
  struct Tag {
    KnownTag tag;
    int region{};    ///< In whose axes it stands; 0: the workspace's.
    bool is_held{};  ///< Its place is given.
  };
  struct Placed {
    Instant at{};
    int region{kNowhere};
    Pose X_WB;
    bool is_sure{};  ///< No other place explains it nearly as well.
  };

  explicit ImagePlacement(std::vector<BodyToPlace> bodies);
  /// A place that is given, and never left.
  void hold(const KnownTag& tag);
  /// One that is thought right. @param component  0: in the workspace
  void suggest(int component, const KnownTag& tag);
  /// Where a tag is by a survey, decimetres off.
  void survey(const KnownTag& tag) { surveyed_.emplace(tag.tag_id, tag); }
  /// A solution: bodies, cameras and tags stand so, unless something else fits much better.
  void take(std::size_t body, const std::vector<CameraBelief>& cameras,
            std::span<const StampedPose> poses);
  void take(const KnownTag& tag);

  /// What the corners of a body are off the solution, 1-sigma of a coordinate: half of the
  /// sightings are nearer than half of all would be with it. Placing goes by it from now on.
  double learn_noise(std::size_t body);

  /// @return whether anything is elsewhere, in another valley, than before
  bool settle();
  /// Where odometry began it, the workspace is moved to where its reference tag says that it is.
  void define_workspace(const WorkspaceGauge& gauge);

  /// In order of the body's log.
  [[nodiscard]] const std::vector<Placed>& placed(std::size_t body) const { return placed_[body]; }
  [[nodiscard]] const std::map<int, Tag>& tags() const { return tags_; }
  /// They are numbered from 0, the workspace's.
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
  std::vector<std::vector<CameraMount>> cameras_;                ///< As thought to be now.
  std::vector<std::vector<Placed>> placed_;
  std::vector<std::vector<bool>> waits_;  ///< Sees a tag that has been placed since.
  std::map<int, std::vector<Sighting>> sightings_;
  std::map<int, Tag> tags_;
  std::map<int, std::map<int, KnownTag>> suggested_;  ///< By component, not yet used.
  std::map<int, KnownTag> surveyed_;
  int regions_{1};
  /// Pairs of tags that were no beginning, and by how many images.
  std::set<std::pair<std::pair<int, int>, std::size_t>> were_tried_;
  bool is_by_odometry_{false};  ///< The workspace is the axes of somebody's odometry.
};

}  // namespace fiducap
