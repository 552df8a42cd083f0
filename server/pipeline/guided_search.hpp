#pragma once

#include <optional>
#include <span>
#include <vector>

#include "detection/tracking/tag_search.hpp"
#include "estimation/tag_belief.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/point_follower.hpp"
#include "pipeline/tag_forecast.hpp"

namespace fiducap {

/// Finds the tags of one body's images where the body's own estimate says that they are:
/// TagForecast and TagSearch together. Live and offline runs use the same one, so that a recording
/// gives the same corners again. With `estimator.landmarks` it also follows other points of the
/// images (PointFollower).
class GuidedSearch final {
 public:
  GuidedSearch(const BodySensors& sensors, const TagSetConfig& tags, const DetectorConfig& detector,
               const EstimatorConfig& estimator);

  void add_imu(const ImuSample& imu);
  /// @param local  the tags in the body's own state: they go before the map's
  /// @return see TagSearch
  const CornerFrame& search(const CameraFrame& frame, std::span<const TagBelief> local,
                            const TagMap& map);
  /// What became of the image. @param estimate  the filter's newest one; nullopt: it does not run
  /// @param cameras  what it knows about them; empty: nothing new
  void learn(const std::optional<BodyEstimate>& estimate,
             std::span<const ExtrinsicsEstimate> cameras);

  /// Where tags were looked for in the last image; empty: in all of it.
  [[nodiscard]] std::span<const ExpectedTag> expected() const { return expected_; }
  [[nodiscard]] const SearchStatistics& statistics() const { return search_.statistics(); }
  /// nullopt: points are not followed.
  [[nodiscard]] std::optional<PointStatistics> points() const;

 private:
  void expect(std::span<const TagBelief> local, const TagMap& map);

  const CornerFrame& with_points(const CameraFrame& frame, const CornerFrame& found, bool aimed);

  bool regions_;
  TagSearch search_;
  TagForecast forecast_;
  std::vector<ExpectedTag> expected_;
  std::vector<int> local_ids_;
  std::vector<CameraModel> models_;
  std::optional<PointFollower> points_;
  CornerFrame with_points_;
};

}  // namespace fiducap
