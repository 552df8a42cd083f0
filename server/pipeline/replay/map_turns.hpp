#pragma once

#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "capture/output_file.hpp"
#include "mapping/map_builder.hpp"
#include "mapping/map_refiner.hpp"

namespace fiducap {

/// The live server's record of one image: the map that its body had, and the order in which bodies
/// contributed. A replay repeats the interleaving of the server's threads with it.
struct MapTurn {
  std::uint64_t turn{};  ///< Contributions to the map before this one.
  std::size_t body{};
  std::int64_t stamp_ns{};  ///< Of the device.
  int camera{};
  std::int64_t revision{};  ///< Of the body's map; 0 at the start of the session.
  bool may_define_workspace{};
  std::optional<Pose> X_WB;  ///< The live filter's; nullopt: no pose in the workspace.
};

/// Writes `turns.csv` (MapTurn) or `refinements.csv` (RefinementTurn) of a recorded session.
template <typename Turn>
class TurnWriter final {
 public:
  [[nodiscard]] static Expected<TurnWriter> create(const std::filesystem::path& path);
  [[nodiscard]] Expected<void> write(const Turn& turn);
  [[nodiscard]] Expected<void> flush() { return csv_.flush(); }
  [[nodiscard]] Expected<void> close() { return csv_.close(); }
  [[nodiscard]] std::uint64_t bytes() const { return csv_.bytes(); }

 private:
  explicit TurnWriter(CsvWriter csv) : csv_(std::move(csv)) {}
  CsvWriter csv_;
};
extern template class TurnWriter<MapTurn>;
extern template class TurnWriter<RefinementTurn>;

/// Sorted by turn. An incomplete last line is left out.
[[nodiscard]] Expected<std::vector<MapTurn>> read_map_turns(const std::filesystem::path& path);
/// In order. An incomplete last line is left out.
[[nodiscard]] Expected<std::vector<RefinementTurn>> read_refinement_turns(
    const std::filesystem::path& path);

}  // namespace fiducap
