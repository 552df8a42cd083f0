#include "tools/verb_inputs.hpp"

#include <charconv>
#include <optional>
#include <sstream>
#include <string_view>

#include "base/whole_file.hpp"

namespace fiducap {
namespace {

constexpr std::string_view kHeader = "id,x,y,z";

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

template <typename Number>
bool parse(std::string_view text, Number& out) {
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), out);
  return failure == std::errc{} && end == text.data() + text.size();
}

std::optional<MeasuredPlace> place_from(std::string_view line) {
  MeasuredPlace place;
  for (int column = 0; column < 4; ++column) {
    const auto comma = line.find(',');
    if ((comma == std::string_view::npos) != (column == 3)) return std::nullopt;
    const std::string_view field = trimmed(line.substr(0, comma));
    if (column == 0 ? !parse(field, place.tag_id) : !parse(field, place.p_RT[column - 1]))
      return std::nullopt;
    line.remove_prefix(column == 3 ? line.size() : comma + 1);
  }
  if (place.tag_id < 0 || !place.p_RT.allFinite()) return std::nullopt;
  return place;
}

}  // namespace

Expected<RecordingReport> require_usable(const RecordingInfo& info, const Terminal& terminal) {
  auto checked = check_recording(info);
  if (!checked) return tl::unexpected(checked.error());
  for (std::size_t i = checked->is_usable() ? 0 : 1; i < checked->findings.size(); ++i) {
    const RecordingFinding& finding = checked->findings[i];
    terminal.err << "fiducap: " << (finding.unusable ? "" : "warning: ") << info.folder << ": "
                 << finding.text << "\n";
  }
  if (checked->is_usable()) return std::move(*checked);
  return fail(ErrorCode::kInvalid, checked->findings.front().text, info.folder);
}

Expected<std::vector<MeasuredPlace>> read_measured_places(const std::string& file) {
  const auto text = read_whole_file(file);
  if (!text) return tl::unexpected(text.error());
  std::vector<MeasuredPlace> places;
  std::istringstream lines(*text);
  bool has_header = false;
  int number = 0;
  for (std::string whole; std::getline(lines, whole);) {
    ++number;
    const std::string_view line = trimmed(whole);
    if (line.empty() || line.front() == '#') continue;
    const std::string where = file + ":" + std::to_string(number);
    if (!has_header) {
      if (line != kHeader)
        return fail(ErrorCode::kInvalid,
                    "expected the header id,x,y,z, got '" + std::string(line) + "'", where);
      has_header = true;
      continue;
    }
    const auto place = place_from(line);
    if (!place)
      return fail(
          ErrorCode::kInvalid,
          "expected a tag's id and its place, three numbers in metres (7,1.25,-0.4,2), got '" +
              std::string(line) + "'",
          where);
    places.push_back(*place);
  }
  if (!has_header)
    return fail(ErrorCode::kInvalid, "expected the header id,x,y,z, got nothing", file);
  return places;
}

}  // namespace fiducap
