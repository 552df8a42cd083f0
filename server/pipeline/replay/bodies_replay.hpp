#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
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
  /// Its samples come by so much later than they say, against those of the others.
  Duration later{0};
};

/// Replayed estimates beside those that the live server had at the same images.
struct LiveAgreement {
  std::uint64_t compared{};
  std::uint64_t different{};  ///< … in any bit, or one of the two had no pose.
  double worst_m{};
  double worst_rad{};
};

/// Several bodies over one live map in virtual time: the same pipelines and MapBuilder as in the
/// server, one after the other in this thread, images of all bodies in order of their time. No
/// clock, no randomness: the same samples give the same result to the last bit.
class BodiesReplay final {
 public:
  /// Called after every image, when its body has told the map.
  using Watch = std::function<void(std::size_t body, const BodyUpdate& update)>;
  /// Every raw sample, before its pipeline gets it.
  using Listener = std::function<void(std::size_t body, const SensorSample& sample)>;

  /// Rough surveys (PipelineSetup::priors) are known to the graph as well.
  BodiesReplay(std::vector<ReplayedBody> bodies, const MapConfig& map, TagMap start);
  /// Follows the order of a recorded session instead of the images' times.
  /// @param refinements  nullopt: not recorded; the map is refined by its period
  void follow(std::vector<MapTurn> turns,
              std::optional<std::vector<RefinementTurn>> refinements = std::nullopt);
  void listen(Listener listener) { listener_ = std::move(listener); }
  /// The map is refined when a tenth of what has been seen by then has been seen since, as well as
  /// after its period: solving costs as much as there is, and all of it costs a few last ones.
  /// Everything is kept.
  void refine_after_share() {
    refine_share_ = 0.1;
    refiner_.keep_all();
  }

  /// @return Error when a source is lost, or IMU readings pile up
  Expected<void> run(const Watch& watch);
  struct LastRefinement {
    bool is_at_rest{};           ///< False: the last solution still moved and was not taken.
    bool has_found_workspace{};  ///< No body ever stood in it: it is where the largest part began.
  };
  /// After run(): with the last piece of everything, until nothing moves any more, laid over the
  /// surveyed tags.
  /// @param progress  called before each round
  LastRefinement refine_to_the_end(const std::function<void(int round)>& progress);

  /// Rounds of solution until nothing moves any more; the map takes over what came of it.
  LastRefinement solve_to_rest(const std::function<void(int round)>& progress);

  [[nodiscard]] MapBuilder& map() { return map_; }
  [[nodiscard]] MapRefiner& refiner() { return refiner_; }
  /// What has been solved for.
  [[nodiscard]] const MapGraph& graph() const { return refiner_.graph(); }
  [[nodiscard]] const BodyPipeline& pipeline(std::size_t body) const {
    return *bodies_[body].pipeline;
  }
  /// Images that the recorded session has no turn for, or the other way round, and refinements that
  /// came to something only here or only there; 0: it was followed.
  [[nodiscard]] std::uint64_t turns_missed() const { return turns_missed_; }
  /// What the body of the newest image was told.
  [[nodiscard]] const MapView& view() const { return view_; }
  /// How far estimates are from those of the recorded session.
  [[nodiscard]] const LiveAgreement& agreement() const { return agreement_; }

 private:
  struct Body {
    int id{};
    std::string name;
    SensorSource* source{};
    Duration later{0};
    std::unique_ptr<BodyPipeline> pipeline;
    bool exhausted{false};
    std::optional<Instant> image_at;  ///< When the next image comes; nullopt: there is none.
  };
  Expected<void> advance(std::size_t body);
  [[nodiscard]] std::optional<std::size_t> earliest() const;
  Expected<void> take_next(std::size_t body, const MapView& view, const Watch& watch);
  Expected<void> run_by_turns(const Watch& watch);
  Expected<void> skip_to(const MapTurn& turn, const Watch& watch);
  [[nodiscard]] static bool is_at(const Body& body, const MapTurn& turn);
  void compare(const MapTurn& turn);
  [[nodiscard]] std::shared_ptr<const TagMap> published(std::int64_t revision) const;

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
  std::optional<bool>
      is_solved_;  ///< Whether the next one has come to something; nullopt: not yet.
  std::deque<MapView> published_;  ///< The newest revisions of the map.
  std::uint64_t turns_missed_{0};
  LiveAgreement agreement_;
  MapView view_;
  std::optional<Pose> last_;  ///< Of the image just taken, when it was placed.
};

}  // namespace fiducap
