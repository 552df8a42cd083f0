#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "capture/recording/recording_writer.hpp"
#include "pipeline/replay/map_turns.hpp"

namespace fiducap {

/// The truth about a simulated body, recorded beside its samples.
struct SimulatedTruth {
  std::function<TruthSample(Instant)> at;
  std::vector<RecordedTag> tags;
  std::vector<Pose> X_BV;
};

/// A body as its recording describes it. `info.name` is its folder in the session's.
struct RecordedBody {
  RecordingInfo info;
  SimulatedTruth truth;
};

/// What a replay starts from.
struct SessionStart {
  std::string config_yaml;     ///< Effective, without secrets.
  std::optional<MapView> map;  ///< As it was then.
  bool is_refined{false};      ///< While the session lasts.
};

/// The folder of one session: a recording per body, `config.yaml`, `map.yaml`, `turns.csv`, and
/// `refinements.csv` when the map is refined. Every call may wait for the disk.
class SessionFiles final {
 public:
  /// @param folder  must not exist: nothing is overwritten
  /// @param bodies  outlive the files
  [[nodiscard]] static Expected<SessionFiles> create(const std::filesystem::path& folder,
                                                     const std::vector<RecordedBody>& bodies,
                                                     const SessionStart& start);

  [[nodiscard]] Expected<void> write(std::size_t body, const SensorSample& sample);
  /// And the truth at its time, where it is known.
  [[nodiscard]] Expected<void> write(MapTurn turn);
  [[nodiscard]] Expected<void> write(const RefinementTurn& turn);
  /// What was written survives the end of the process.
  [[nodiscard]] Expected<void> flush();
  [[nodiscard]] Expected<void> close();
  /// On disk.
  [[nodiscard]] std::uint64_t bytes() const;

 private:
  explicit SessionFiles(const std::vector<RecordedBody>& bodies) : bodies_(bodies) {}
  [[nodiscard]] Expected<void> open_body(const std::filesystem::path& folder,
                                         const RecordedBody& body);
  [[nodiscard]] Expected<void> open_surroundings(const std::filesystem::path& folder,
                                                 const SessionStart& start);

  std::reference_wrapper<const std::vector<RecordedBody>> bodies_;
  std::vector<RecordingWriter> writers_;
  std::optional<MapTurnWriter> turns_;
  std::optional<RefinementTurnWriter> refinements_;
  std::uint64_t first_revision_{};
  std::uint64_t surroundings_bytes_{};
};

}  // namespace fiducap
