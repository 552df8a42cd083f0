#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "capture/recording/csv_writer.hpp"
#include "mapping/map_builder.hpp"
#include "mapping/map_refiner.hpp"

namespace fiducap {

/// What the live server noted about one image: which map its body had, and in which order the
/// bodies told the map. With it a replay repeats how the threads of the server happened to run.
struct MapTurn {
  std::uint64_t turn{};  ///< Contributions to the map before this one.
  std::size_t body{};
  std::int64_t stamp_ns{};  ///< Of the device.
  int camera{};
  std::int64_t revision{};  ///< Of the map that the body had; 0 is that of the session's start.
  bool may_define_workspace{};
  std::optional<Pose> X_WB;  ///< What the live filter then said; nullopt: no pose in the workspace.
};

/// `turns.csv` of a recorded session.
class MapTurnWriter final {
 public:
  [[nodiscard]] static Expected<MapTurnWriter> create(const std::filesystem::path& path);
  [[nodiscard]] Expected<void> write(const MapTurn& turn);
  [[nodiscard]] Expected<void> flush() { return csv_.flush(); }
  [[nodiscard]] Expected<void> close() { return csv_.close(); }
  [[nodiscard]] std::uint64_t bytes() const { return csv_.bytes(); }

 private:
  explicit MapTurnWriter(CsvWriter csv) : csv_(std::move(csv)) {}
  CsvWriter csv_;
};

/// Sorted by turn. A last line that was cut is left out.
[[nodiscard]] Expected<std::vector<MapTurn>> read_map_turns(const std::filesystem::path& path);

/// `refinements.csv` of a recorded session whose map was refined.
class RefinementTurnWriter final {
 public:
  [[nodiscard]] static Expected<RefinementTurnWriter> create(const std::filesystem::path& path);
  [[nodiscard]] Expected<void> write(const RefinementTurn& turn);
  [[nodiscard]] Expected<void> flush() { return csv_.flush(); }
  [[nodiscard]] Expected<void> close() { return csv_.close(); }
  [[nodiscard]] std::uint64_t bytes() const { return csv_.bytes(); }

 private:
  explicit RefinementTurnWriter(CsvWriter csv) : csv_(std::move(csv)) {}
  CsvWriter csv_;
};

/// As they came, one after the other. A last line that was cut is left out.
[[nodiscard]] Expected<std::vector<RefinementTurn>> read_refinement_turns(
    const std::filesystem::path& path);

}  // namespace fiducap
