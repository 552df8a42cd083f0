#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "capture/sensor_source.hpp"
#include "mapping/map_builder.hpp"
#include "mapping/map_refiner.hpp"
#include "pipeline/body_pipeline.hpp"
#include "pipeline/replay/map_turns.hpp"

namespace fiducap {

/// One robot of a replay.
struct ReplayedBody {
  int id{1};
  std::string name;
  PipelineSetup setup;
  SensorSource* source{};  ///< Outlives the replay.
  Duration later{0};       ///< Added to its stamps for the order of the images.
};

/// Replayed estimates compared with those of the live server.
struct LiveAgreement {
  std::uint64_t compared{};
  std::uint64_t different{};  ///< In any bit, or one of the two had no pose.
  double worst_m{};
  double worst_rad{};
};

/// Runs several bodies over one live map in virtual time: the pipelines and MapBuilder of the
/// server, in this thread, images of all bodies in order of time. No clock, no randomness: the same
/// samples give the same result to the last bit.
class BodiesReplay final {
 public:
  /// Called after every image and its contribution to the map.
  using Watch = std::function<void(std::size_t body, const BodyUpdate& update)>;
  /// Every raw sample, before its pipeline gets it.
  using Listener = std::function<void(std::size_t body, const SensorSample& sample)>;

  /// Rough surveys (PipelineSetup::priors) are also priors of the graph.
  BodiesReplay(std::vector<ReplayedBody> bodies, const MapConfig& map, TagMap start);
  /// Follows the order of a recorded session instead of the images' times.
  /// @param refinements  nullopt: not recorded; the map is refined by its period
  void follow(std::vector<MapTurn> turns,
              std::optional<std::vector<RefinementTurn>> refinements = std::nullopt);
  void listen(Listener listener) { listener_ = std::move(listener); }
  /// Refines the map only after a tenth of the time so far (and its period), which bounds the total
  /// cost to that of a few last solutions. Keeps all segments.
  void refine_after_share() {
    refine_share_ = 0.1;
    refiner_.keep_all();
  }

  /// @return Error when a source is lost, or IMU readings pile up
  Expected<void> run(const Watch& watch);
  struct LastRefinement {
    bool is_at_rest{};           ///< False: the last solution did not converge and was not taken.
    bool has_found_workspace{};  ///< No body was anchored: it is where the largest part began.
  };
  /// After run(): takes the last segments and solves to convergence, aligned to the surveyed tags.
  /// @param progress  called before each round
  LastRefinement refine_to_the_end(const std::function<void(int round)>& progress);
  /// Solves until convergence; the map adopts the result.
  LastRefinement solve_to_rest(const std::function<void(int round)>& progress);

  [[nodiscard]] MapBuilder& map() { return map_; }
  [[nodiscard]] MapRefiner& refiner() { return refiner_; }
  [[nodiscard]] const MapGraph& graph() const { return refiner_.graph(); }
  [[nodiscard]] const BodyPipeline& pipeline(std::size_t body) const {
    return *bodies_[body].pipeline;
  }
  /// Images without a recorded turn or turns without an image, and refinements that succeeded only
  /// here or only live; 0: the session was followed.
  [[nodiscard]] std::uint64_t turns_missed() const { return turns_missed_; }
  /// The map for the newest image.
  [[nodiscard]] const MapView& view() const { return view_; }
  [[nodiscard]] const LiveAgreement& agreement() const { return agreement_; }

 private:
  struct Body : ReplayedBody {
    std::unique_ptr<BodyPipeline> pipeline;
    bool exhausted{false};
    std::optional<Instant> image_at;  ///< Time of the next image; nullopt: there is none.
  };
  Expected<void> advance(std::size_t body);
  [[nodiscard]] std::optional<std::size_t> earliest() const;
  Expected<void> take_next(std::size_t body, const MapView& view, const Watch& watch);
  Expected<void> run_by_turns(const Watch& watch);
  Expected<void> skip_to(const MapTurn& turn, const Watch& watch);
  [[nodiscard]] static bool is_at(const Body& body, const MapTurn& turn);
  void compare(const MapTurn& turn);

  std::vector<Body> bodies_;
  void refine(Instant now);
  void refine_as_before(std::uint64_t turn);
  void remember(const MapView& view);

  MapBuilder map_;
  MapRefiner refiner_;
  Duration refine_period_;
  double refine_share_{0};
  std::optional<Instant> began_at_;
  Instant refined_at_{};
  Instant newest_{Instant::min()};  ///< Image, by its own time.
  Listener listener_;
  std::vector<MapTurn> turns_;
  std::optional<std::deque<RefinementTurn>> refinements_;  ///< Those to come.
  std::optional<bool> is_solved_;  ///< Result of the next one; nullopt: not solved yet.
  std::deque<MapView> published_;  ///< The newest revisions of the map.
  std::uint64_t turns_missed_{0};
  LiveAgreement agreement_;
  MapView view_;
  std::optional<Pose> last_;  ///< Of the newest image, if it was placed.
};

}  // namespace fiducap
