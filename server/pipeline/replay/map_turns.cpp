#include "pipeline/replay/map_turns.hpp"

#include <algorithm>
#include <utility>

#include "capture/recording/csv_reader.hpp"

namespace fiducap {

namespace {
constexpr const char* kHeader =
    "#turn,body,timestamp [ns],camera,map_revision,may_define_workspace,px,py,pz,qw,qx,qy,qz";
constexpr const char* kRefinementHeader = "#taken_after,adopted_after";
constexpr std::size_t kWithoutPose = 6;
constexpr std::size_t kWithPose = 13;
}  // namespace

Expected<MapTurnWriter> MapTurnWriter::create(const std::filesystem::path& path) {
  auto csv = CsvWriter::create(path, kHeader);
  if (!csv) return tl::unexpected(csv.error());
  return MapTurnWriter(std::move(*csv));
}

Expected<void> MapTurnWriter::write(const MapTurn& turn) {
  csv_.integer(static_cast<std::int64_t>(turn.turn))
      .integer(static_cast<std::int64_t>(turn.body))
      .integer(turn.stamp_ns)
      .integer(turn.camera)
      .integer(turn.revision)
      .integer(turn.may_define_workspace ? 1 : 0);
  if (turn.X_WB) csv_.exact(turn.X_WB->p).exact(turn.X_WB->q.w()).exact(turn.X_WB->q.vec());
  return csv_.end_line();
}

Expected<std::vector<MapTurn>> read_map_turns(const std::filesystem::path& path) {
  auto csv = CsvReader::open(path);
  if (!csv) return tl::unexpected(csv.error());
  std::vector<MapTurn> turns;
  while (csv->next()) {
    const auto fields = csv->fields();
    MapTurn turn;
    int may_define = 0;
    std::array<double, 7> pose{};
    const bool placed = fields.size() == kWithPose;
    const bool good = (placed || fields.size() == kWithoutPose) && csv->line_is_complete() &&
                      (!placed || parse(fields.subspan(kWithoutPose), pose)) &&
                      parse(fields[0], turn.turn) && parse(fields[1], turn.body) &&
                      parse(fields[2], turn.stamp_ns) && parse(fields[3], turn.camera) &&
                      parse(fields[4], turn.revision) && parse(fields[5], may_define);
    if (!good) {
      csv->count_damaged();
      continue;
    }
    turn.may_define_workspace = may_define != 0;
    if (placed) turn.X_WB = Pose{{pose[3], pose[4], pose[5], pose[6]}, {pose[0], pose[1], pose[2]}};
    turns.push_back(turn);
  }
  csv->log_damage();
  std::stable_sort(turns.begin(), turns.end(),
                   [](const MapTurn& a, const MapTurn& b) { return a.turn < b.turn; });
  return turns;
}

Expected<RefinementTurnWriter> RefinementTurnWriter::create(const std::filesystem::path& path) {
  auto csv = CsvWriter::create(path, kRefinementHeader);
  if (!csv) return tl::unexpected(csv.error());
  return RefinementTurnWriter(std::move(*csv));
}

Expected<void> RefinementTurnWriter::write(const RefinementTurn& turn) {
  csv_.integer(static_cast<std::int64_t>(turn.taken));
  if (turn.adopted) csv_.integer(static_cast<std::int64_t>(*turn.adopted));
  return csv_.end_line();
}

Expected<std::vector<RefinementTurn>> read_refinement_turns(const std::filesystem::path& path) {
  auto csv = CsvReader::open(path);
  if (!csv) return tl::unexpected(csv.error());
  std::vector<RefinementTurn> turns;
  while (csv->next()) {
    const auto fields = csv->fields();
    RefinementTurn turn;
    std::uint64_t adopted = 0;
    const bool is_adopted = fields.size() == 2;
    const bool good = (is_adopted || fields.size() == 1) && csv->line_is_complete() &&
                      parse(fields[0], turn.taken) && (!is_adopted || parse(fields[1], adopted)) &&
                      (!is_adopted || adopted >= turn.taken);
    if (!good) {
      csv->count_damaged();
      continue;
    }
    if (is_adopted) turn.adopted = adopted;
    turns.push_back(turn);
  }
  csv->log_damage();
  std::stable_sort(
      turns.begin(), turns.end(),
      [](const RefinementTurn& a, const RefinementTurn& b) { return a.taken < b.taken; });
  return turns;
}

}  // namespace fiducap
