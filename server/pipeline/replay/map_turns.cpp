#include "pipeline/replay/map_turns.hpp"

#include <algorithm>
#include <array>

#include "capture/recording/csv_reader.hpp"

namespace fiducap {
namespace {

constexpr const char* header_of(const MapTurn*) {
  return "#turn,body,timestamp [ns],camera,map_revision,may_define_workspace,px,py,pz,qw,qx,qy,qz";
}
constexpr const char* header_of(const RefinementTurn*) { return "#taken_after,adopted_after"; }

void write_fields(CsvWriter& csv, const MapTurn& turn) {
  csv.integer(static_cast<std::int64_t>(turn.turn))
      .integer(static_cast<std::int64_t>(turn.body))
      .integer(turn.stamp_ns)
      .integer(turn.camera)
      .integer(turn.revision)
      .integer(turn.may_define_workspace ? 1 : 0);
  if (turn.X_WB) csv.exact(turn.X_WB->p).exact(turn.X_WB->q.w()).exact(turn.X_WB->q.vec());
}

void write_fields(CsvWriter& csv, const RefinementTurn& turn) {
  csv.integer(static_cast<std::int64_t>(turn.taken));
  if (turn.adopted) csv.integer(static_cast<std::int64_t>(*turn.adopted));
}

using Fields = std::span<const std::string_view>;

bool read_fields(Fields fields, MapTurn& turn) {
  constexpr std::size_t kWithoutPose = 6;
  constexpr std::size_t kWithPose = 13;
  int may_define = 0;
  std::array<double, 7> pose{};
  const bool placed = fields.size() == kWithPose;
  const bool good = (placed || fields.size() == kWithoutPose) &&
                    (!placed || parse(fields.subspan(kWithoutPose), pose)) &&
                    parse_number(fields[0], turn.turn) && parse_number(fields[1], turn.body) &&
                    parse_number(fields[2], turn.stamp_ns) &&
                    parse_number(fields[3], turn.camera) &&
                    parse_number(fields[4], turn.revision) && parse_number(fields[5], may_define);
  turn.may_define_workspace = may_define != 0;
  if (placed) turn.X_WB = Pose{{pose[3], pose[4], pose[5], pose[6]}, {pose[0], pose[1], pose[2]}};
  return good;
}

bool read_fields(Fields fields, RefinementTurn& turn) {
  std::uint64_t adopted = 0;
  const bool is_adopted = fields.size() == 2;
  const bool good = (is_adopted || fields.size() == 1) && parse_number(fields[0], turn.taken) &&
                    (!is_adopted || (parse_number(fields[1], adopted) && adopted >= turn.taken));
  if (is_adopted) turn.adopted = adopted;
  return good;
}

template <typename Turn>
Expected<std::vector<Turn>> read_turns(const std::filesystem::path& path,
                                       std::uint64_t Turn::*order) {
  auto csv = CsvReader::open(path);
  if (!csv) return tl::unexpected(csv.error());
  std::vector<Turn> turns;
  while (csv->next()) {
    Turn turn;
    if (csv->line_is_complete() && read_fields(csv->fields(), turn))
      turns.push_back(turn);
    else
      csv->count_damaged();
  }
  csv->log_damage();
  std::ranges::stable_sort(turns,
                           [&](const Turn& a, const Turn& b) { return a.*order < b.*order; });
  return turns;
}

}  // namespace

template <typename Turn>
Expected<TurnWriter<Turn>> TurnWriter<Turn>::create(const std::filesystem::path& path) {
  auto csv = CsvWriter::create(path, header_of(static_cast<const Turn*>(nullptr)));
  if (!csv) return tl::unexpected(csv.error());
  return TurnWriter(std::move(*csv));
}

template <typename Turn>
Expected<void> TurnWriter<Turn>::write(const Turn& turn) {
  write_fields(csv_, turn);
  return csv_.end_line();
}

template class TurnWriter<MapTurn>;
template class TurnWriter<RefinementTurn>;

Expected<std::vector<MapTurn>> read_map_turns(const std::filesystem::path& path) {
  return read_turns(path, &MapTurn::turn);
}

Expected<std::vector<RefinementTurn>> read_refinement_turns(const std::filesystem::path& path) {
  return read_turns(path, &RefinementTurn::taken);
}

}  // namespace fiducap
