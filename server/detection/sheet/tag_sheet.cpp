#include "detection/sheet/tag_sheet.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <set>

#include "detection/sheet/pdf_document.hpp"
#include "detection/tag_family.hpp"

namespace fiducap {
namespace {

constexpr double kMargin_mm = 4;   // printers may cut this edge of the paper
constexpr double kGap_mm = 6;      // between two tags, for the cut marks
constexpr double kLabel_mm = 9;    // strip above each tag: arrow and text
constexpr double kFooter_mm = 26;  // ruler and note
constexpr double kCutMark_mm = 2.5;
constexpr double kSizeMark_mm = 1.8;
constexpr double kHairline_mm = 0.15;
constexpr int kLargestId = 65535;  // no family has more
constexpr std::size_t kMaxIds = 10000;

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return text.data();
}

/// Grid of the tags of one page.
struct Layout {
  double zone_mm{};  ///< Side of a tag with its white zone.
  int columns{};
  int rows{};

  [[nodiscard]] std::size_t per_page() const { return static_cast<std::size_t>(columns * rows); }
  [[nodiscard]] PdfPage::Point lower_left(const Paper& paper, std::size_t slot) const {
    const int column = static_cast<int>(slot) % columns;
    const int row = static_cast<int>(slot) / columns;
    const double used = columns * zone_mm + (columns - 1) * kGap_mm;
    return {(paper.width_mm - used) / 2 + column * (zone_mm + kGap_mm),
            paper.height_mm - kMargin_mm - (row + 1) * (zone_mm + kLabel_mm) - row * kGap_mm};
  }
};

/// The outermost cells of a reversed border may be black: a white ring is added.
int ring_cells(const TagFamily& family) { return family.has_reversed_border() ? 1 : 0; }

Expected<Layout> lay_out(const TagSheetOrder& order, const TagFamily& family) {
  const double zones_per_size =
      static_cast<double>(family.width() + 2 * ring_cells(family)) / family.edge_width();
  Layout layout{order.size_mm * zones_per_size, 0, 0};
  const double width = order.paper.width_mm - 2 * kMargin_mm;
  const double height = order.paper.height_mm - 2 * kMargin_mm - kFooter_mm;
  layout.columns = static_cast<int>((width + kGap_mm) / (layout.zone_mm + kGap_mm) + 1e-9);
  layout.rows =
      static_cast<int>((height + kGap_mm) / (layout.zone_mm + kLabel_mm + kGap_mm) + 1e-9);
  if (layout.columns > 0 && layout.rows > 0) return layout;
  const double largest = std::floor(std::min(width, height - kLabel_mm) / zones_per_size);
  return fail(ErrorCode::kInvalid, "a tag of " + number(order.size_mm) + " mm does not fit on " +
                                       order.paper.name + " with its white zone; up to " +
                                       number(largest) + " mm fit, or use larger paper (a3)");
}

/// One rectangle per run of black cells in a row.
std::vector<PdfPage::Rectangle> black_runs(const TagFamily& family, int id, PdfPage::Point corner,
                                           double cell_mm) {
  const int width = family.width();
  const std::vector<std::uint8_t> cells = family.cells(id);
  const auto is_black = [&](int column, int row) {
    return cells[static_cast<std::size_t>(row * width + column)] == 0;
  };
  std::vector<PdfPage::Rectangle> runs;
  for (int row = 0; row < width; ++row) {
    for (int column = 0; column < width;) {
      int end = column;
      while (end < width && is_black(end, row)) ++end;
      if (end > column)
        runs.push_back({corner.x + column * cell_mm, corner.y + (width - 1 - row) * cell_mm,
                        (end - column) * cell_mm, cell_mm});
      column = end + 1;
    }
  }
  return runs;
}

void draw_cut_marks(PdfPage& page, PdfPage::Point corner, double side) {
  for (const double right : {0.0, 1.0}) {
    for (const double top : {0.0, 1.0}) {
      const PdfPage::Point at{corner.x + right * side, corner.y + top * side};
      const double out_x = right > 0 ? 1 : -1;
      const double out_y = top > 0 ? 1 : -1;
      page.line({at.x + 0.5 * out_x, at.y}, {at.x + kCutMark_mm * out_x, at.y}, kHairline_mm);
      page.line({at.x, at.y + 0.5 * out_y}, {at.x, at.y + kCutMark_mm * out_y}, kHairline_mm);
    }
  }
}

/// Marks below and left of a tag, in line with its edge, at the distance of the tag size.
void draw_size_marks(PdfPage& page, PdfPage::Point zone, double side, double size_mm) {
  for (const double from : {(side - size_mm) / 2, (side + size_mm) / 2}) {
    page.line({zone.x + from, zone.y - 0.5}, {zone.x + from, zone.y - kSizeMark_mm}, kHairline_mm);
    page.line({zone.x - 0.5, zone.y + from}, {zone.x - kSizeMark_mm, zone.y + from}, kHairline_mm);
  }
}

void draw_label(PdfPage& page, PdfPage::Point zone, double side, const std::string& text) {
  const double base = zone.y + side + 3.2;
  const double arrow = std::min(4.0, side / 6);
  const double x = zone.x + 1.5;
  page.fill_polygon({{x, base}, {x + arrow, base}, {x + arrow / 2, base + arrow}});
  // Helvetica is about half as wide as high.
  const double room = side - arrow - 4;
  const double letters = std::clamp(room / (0.56 * static_cast<double>(text.size())), 0.8, 4.0);
  page.text({x + arrow + 1.2, base}, letters, text);
}

void draw_tag(PdfPage& page, const TagFamily& family, int id, PdfPage::Point zone,
              const Layout& layout, const TagSheetOrder& order) {
  const double cell = order.size_mm / family.edge_width();
  const double ring = ring_cells(family) * cell;
  page.fill(black_runs(family, id, {zone.x + ring, zone.y + ring}, cell));
  draw_cut_marks(page, zone, layout.zone_mm);
  draw_size_marks(page, zone, layout.zone_mm, order.size_mm);
  draw_label(page, zone, layout.zone_mm,
             "UP   id " + std::to_string(id) + "   " + order.family + "   " +
                 number(order.size_mm) + " mm");
}

void draw_ruler(PdfPage& page) {
  constexpr double kLength_mm = 100;
  const PdfPage::Point left{(page.width_mm() - kLength_mm) / 2, kMargin_mm + 9};
  page.line(left, {left.x + kLength_mm, left.y}, kHairline_mm);
  for (int mm = 0; mm <= static_cast<int>(kLength_mm); ++mm) {
    const double height = mm % 10 == 0 ? 4.0 : mm % 5 == 0 ? 2.8 : 1.6;
    page.line({left.x + mm, left.y}, {left.x + mm, left.y + height}, kHairline_mm);
    if (mm % 10 != 0) continue;
    const double half_width = mm < 10 ? 0.6 : mm < 100 ? 1.3 : 1.9;
    page.text({left.x + mm - half_width, left.y + 5}, 2.4, std::to_string(mm));
  }
  page.text({left.x - 24, kMargin_mm + 4}, 3.0,
            "Print at 100 %, no scaling, no \"fit to page\". Then measure: this ruler must be 100 "
            "mm long.");
  page.text({left.x - 24, kMargin_mm + 0.5}, 2.4,
            "Keep the white zone inside the cut marks. Glue to a flat, stiff plate. Arrow = upper "
            "edge. The tag size is the distance of the marks below it.");
}

}  // namespace

std::optional<Paper> paper_named(std::string_view name) {
  if (name == "a4") return Paper{"a4", 210, 297};
  if (name == "a3") return Paper{"a3", 297, 420};
  if (name == "letter") return Paper{"letter", 215.9, 279.4};
  return std::nullopt;
}

Expected<std::vector<int>> parse_id_list(std::string_view text) {
  const auto bad = [&](std::string_view part) {
    return fail(ErrorCode::kInvalid,
                "'" + std::string(part) + "' in '" + std::string(text) +
                    "' is neither an id nor a range; write for example 0-11 or 0,3,7-9");
  };
  std::vector<int> ids;
  std::set<int> seen;
  for (std::string_view rest = text;;) {
    const std::size_t comma = rest.find(',');
    const std::string_view part = rest.substr(0, comma);
    int first = -1;
    const char* const end = part.data() + part.size();
    auto parsed = std::from_chars(part.data(), end, first);
    int last = first;
    if (parsed.ec == std::errc{} && parsed.ptr != end && *parsed.ptr == '-')
      parsed = std::from_chars(parsed.ptr + 1, end, last);
    if (parsed.ec != std::errc{} || parsed.ptr != end || first < 0 || last < first ||
        last > kLargestId)
      return bad(part);
    for (int id = first; id <= last; ++id)
      if (seen.insert(id).second) ids.push_back(id);
    if (ids.size() > kMaxIds)
      return fail(ErrorCode::kInvalid, "'" + std::string(text) + "' has more than " +
                                           std::to_string(kMaxIds) + " tags: list fewer");
    if (comma == std::string_view::npos) return ids;
    rest.remove_prefix(comma + 1);
  }
}

Expected<std::string> tag_sheet_pdf(const TagSheetOrder& order) {
  if (!std::isfinite(order.size_mm) || order.size_mm < 5)
    return fail(ErrorCode::kInvalid, "a tag of " + number(order.size_mm) +
                                         " mm cannot be printed; 5 mm is the smallest size");
  if (order.ids.empty()) return fail(ErrorCode::kInvalid, "no ids given");
  const auto family = TagFamily::named(order.family);
  if (!family) return tl::unexpected(family.error());
  for (const int id : order.ids)
    if (const std::string fault = family->fault_of(id); !fault.empty())
      return fail(ErrorCode::kInvalid, "id " + std::to_string(id) + ": " + fault);
  const auto layout = lay_out(order, *family);
  if (!layout) return tl::unexpected(layout.error());

  std::vector<PdfPage> pages;
  for (std::size_t i = 0; i < order.ids.size(); ++i) {
    const std::size_t slot = i % layout->per_page();
    if (slot == 0) {
      pages.emplace_back(order.paper.width_mm, order.paper.height_mm);
      draw_ruler(pages.back());
    }
    draw_tag(pages.back(), *family, order.ids[i], layout->lower_left(order.paper, slot), *layout,
             order);
  }
  return to_pdf(pages, "Fiducap tags " + order.family + ", " + number(order.size_mm) + " mm");
}

std::string tag_sheet_yaml(const TagSheetOrder& order) {
  const std::string size_m = number(order.size_mm / 1000);
  std::string text(kTagSheetHeading);
  text += " Put the lines below `tags:` into the server's configuration.\ntags:\n";
  text += "  family: " + order.family + "\n  size_m: " + size_m;
  text += "   # edge between black and white border; correct it if the printed size differs\n";
  text += "  sizes_m:\n";
  for (const int id : order.ids) text += "    " + std::to_string(id) + ": " + size_m + "\n";
  return text;
}

}  // namespace fiducap
