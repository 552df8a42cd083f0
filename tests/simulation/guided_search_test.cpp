// Regions, forecast and filter together, on rendered images.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "detection/observe.hpp"
#include "pipeline/body_pipeline.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/simulation.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

struct SearchOutcome {
  SearchStatistics settled;  ///< After the start.
  int images{};
  int found{};
  double squares_px2{};
  int points{};
  int landmarks{};
};

CameraMount small_camera() {
  CameraMount mount;
  mount.model = {376, 240, 230, 230, 187.5, 119.5, Distortion::kRadialTangential, {}};
  mount.model.coefficients = {-0.28, 0.07, 2e-4, 2e-5, 0};
  mount.X_BV = simulation::forward_camera();
  return mount;
}

/// The pipeline of a body in a room; compares tags that it finds with the truth.
class SearchLoop {
 public:
  SearchLoop(const simulation::RoomConfig& room, const DetectorConfig& detector,
             const EstimatorConfig& estimator)
      : tags_(simulation::tags_of(room)), pipeline_(setup_of(tags_, detector, estimator)) {}

  SearchOutcome run(simulation::SimulatedSource& source) {
    for (bool more = true; more;) {
      auto next = value_of(source.next({}));
      more = next.has_value();
      if (more) {
        (void)pipeline_.push(std::move(*next));
      } else {
        pipeline_.finish();
      }
      while (pipeline_.next() != nullptr) {
        if (const BodyUpdate* update = pipeline_.take(empty_)) take(*update, source);
      }
    }
    outcome_.settled = pipeline_.statistics().search;
    outcome_.settled.whole_images -= start_.whole_images;
    outcome_.settled.images -= start_.images;
    outcome_.settled.expected -= start_.expected;
    outcome_.settled.found -= start_.found;
    return outcome_;
  }

 private:
  static PipelineSetup setup_of(const std::vector<RecordedTag>& tags,
                                const DetectorConfig& detector, const EstimatorConfig& estimator) {
    PipelineSetup setup;
    setup.sensors = {{small_camera()}, simulation::ImuErrors{}.noise};
    for (const RecordedTag& tag : tags) setup.tags.sizes_m[tag.tag_id] = tag.edge_m;
    setup.detector = detector;
    setup.estimator = estimator;
    return setup;
  }

  void take(const BodyUpdate& update, simulation::SimulatedSource& source) {
    outcome_.landmarks += update.report.landmarks_used;
    outcome_.points += static_cast<int>(update.corners.points.size());
    const Instant at = update.corners.exposed_at;
    if (to_seconds(at - instant_from_ns(0)) < 3) {
      start_ = pipeline_.statistics().search;
      return;
    }
    ++outcome_.images;
    // True time of the image, not the filter's.
    const Instant taken_at = at - update.corners.clock_shift;
    const Pose X_VW = (source.truth(taken_at).X_WB * mount().X_BV).inverse();
    for (const TagSighting& tag : update.corners.tags) compare(tag, X_VW);
  }

  void compare(const TagSighting& tag, const Pose& X_VW) {
    const auto truth = std::find_if(tags_.begin(), tags_.end(),
                                    [&](const auto& t) { return t.tag_id == tag.tag_id; });
    ASSERT_NE(truth, tags_.end());
    const auto corners = unbend_corners(mount().model, tag.corners_px);
    const auto corners_W = simulation::corners_of(*truth);
    ++outcome_.found;
    for (std::size_t i = 0; i < 4; ++i)
      outcome_.squares_px2 +=
          (corners[i] - *mount().model.project(X_VW * corners_W[i])).squaredNorm() / 8;
  }
  [[nodiscard]] const CameraMount& mount() const {
    return pipeline_.setup().sensors.cameras.front();
  }

  std::vector<RecordedTag> tags_;
  BodyPipeline pipeline_;
  MapView empty_{std::make_shared<const TagMap>()};
  SearchOutcome outcome_;
  SearchStatistics start_;
};

SearchOutcome run_search(const std::string& room_name, double seconds,
                         const DetectorConfig& detector, const EstimatorConfig& estimator = {},
                         const std::string& texture = "clutter") {
  simulation::RoomConfig room;
  room.preset = room_name;
  room.texture = texture;
  simulation::SimulatedBodyConfig body;
  body.cameras = {small_camera()};
  body.trajectory.kind = room_name == "hall" ? "survey" : room_name;
  body.trajectory.duration_s = seconds;
  const auto source =
      value_of(simulation::make_simulated_source(room, body, instant_from_ns(0), nullptr));
  return SearchLoop(room, detector, estimator).run(*source);
}

TEST(GuidedSearch, FindsTagsWithFewWholeImages) {
  DetectorConfig whole;
  whole.regions = false;
  for (const char* room : {"hall", "table"}) {
    const SearchOutcome guided = run_search(room, 8, {});
    const SearchOutcome all = run_search(room, 8, whole);
    SCOPED_TRACE(room);
    ASSERT_GT(all.found, 100);
    ASSERT_EQ(guided.images, all.images);
    EXPECT_GE(guided.found, all.found * 98 / 100);
    EXPECT_GE(guided.settled.found, guided.settled.expected * 97 / 100);
    // One in ten by schedule; tags that leave the image cause a few more.
    EXPECT_LE(guided.settled.whole_images, guided.settled.images / 5);
    EXPECT_EQ(all.settled.whole_images, all.settled.images);
    constexpr double kNoWorse = 1.1;
    EXPECT_LT(std::sqrt(guided.squares_px2 / guided.found),
              kNoWorse * std::sqrt(all.squares_px2 / all.found));
  }
}

TEST(GuidedSearch, FollowsPointsOfATexturedRoom) {
  EstimatorConfig estimator;
  const SearchOutcome without = run_search("loop", 5, {}, estimator, "sharp");
  EXPECT_EQ(without.points, 0);
  EXPECT_EQ(without.landmarks, 0);
  estimator.landmarks = true;
  const SearchOutcome with = run_search("loop", 5, {}, estimator, "sharp");
  EXPECT_GT(with.points, 50 * 20);  // every second image of 100
  EXPECT_GT(with.landmarks, 50);
}

}  // namespace
}  // namespace fiducap
