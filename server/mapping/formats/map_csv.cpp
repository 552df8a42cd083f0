// The CSV format of the recordings.
#include <array>
#include <string_view>

#include "mapping/formats/map_exchange.hpp"
#include "mapping/formats/map_format.hpp"

namespace fiducap {

namespace {

constexpr std::string_view kHeader = "id,size,px,py,pz,qw,qx,qy,qz";
constexpr std::array<std::string_view, 9> kColumns{"id", "size", "px", "py", "pz",
                                                   "qw", "qx",   "qy", "qz"};

std::string_view trimmed(std::string_view text) {
  const auto is_blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// Cuts off and returns the text before the next `end`.
std::string_view take_until(std::string_view& rest, char end) {
  const auto at = rest.find(end);
  const auto taken = rest.substr(0, at);
  rest.remove_prefix(at == std::string_view::npos ? rest.size() : at + 1);
  return taken;
}

tl::unexpected<Error> broken(std::size_t column, std::string_view field, const char* rule,
                             const std::string& context) {
  return fail(ErrorCode::kInvalid,
              std::string(kColumns[column]) + " = '" + std::string(field) + "': " + rule, context);
}

Expected<MapTag> csv_tag(std::string_view line, const std::string& context) {
  std::array<std::string_view, 9> fields;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (line.empty())
      return fail(ErrorCode::kInvalid,
                  "expected 9 columns (" + std::string(kHeader) + "), found " + std::to_string(i),
                  context);
    fields[i] = trimmed(take_until(line, ','));
  }
  if (!line.empty()) return fail(ErrorCode::kInvalid, "more than 9 columns", context);

  std::array<double, 9> values{};
  for (std::size_t i = 1; i < fields.size(); ++i) {
    const auto value = number_from<double>(fields[i]);
    if (!value) return broken(i, fields[i], "must be a finite number", context);
    values[i] = *value;
  }
  const auto id = number_from<int>(fields[0]);
  if (!id) return broken(0, fields[0], "must be a whole number", context);
  MapTag entry;
  entry.state = TagState::kSurveyed;
  entry.tag.tag_id = *id;
  entry.tag.edge_m = values[1];
  entry.tag.X_WT.p = {values[2], values[3], values[4]};
  entry.tag.X_WT.q = {values[5], values[6], values[7], values[8]};
  return entry;
}

}  // namespace

std::string map_to_csv(const TagMap& map) {
  std::string text(kHeader);
  text += '\n';
  for (const MapTag& entry : map.tags) {
    const auto& [q, p] = entry.tag.X_WT;
    text += std::to_string(entry.tag.tag_id);
    for (const double v : {entry.tag.edge_m, p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()})
      text += ',' + shortest(v);
    text += '\n';
  }
  return text;
}

Expected<TagMap> map_from_csv(const std::string& text, const std::string& context) {
  if (auto fits = check_length(text, context); !fits) return tl::unexpected<Error>(fits.error());
  std::string_view rest = text;
  if (const auto header = trimmed(take_until(rest, '\n')); header != kHeader)
    return fail(ErrorCode::kInvalid, "expected the header '" + std::string(kHeader) + "'",
                context + ":1");
  ImportedTags imported;
  for (int line_number = 2; !rest.empty(); ++line_number) {
    const auto line = trimmed(take_until(rest, '\n'));
    if (line.empty() || line.front() == '#') continue;
    const std::string place = context + ":" + std::to_string(line_number);
    auto entry = csv_tag(line, place);
    if (!entry) return tl::unexpected<Error>(entry.error());
    if (auto added = imported.add(std::move(*entry), place); !added)
      return tl::unexpected<Error>(added.error());
  }
  TagMap map;
  map.tags = imported.take();
  return map;
}

}  // namespace fiducap
