#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace fiducap {

/// Colours that everything drawn shares; a page turns them round in the dark (plot_page).
inline constexpr const char* kSvgInk = "#333";
inline constexpr const char* kSvgPaper = "#fff";
inline constexpr const char* kSvgGrid = "#d8dce2";
inline constexpr const char* kSvgBorder = "#8a93a0";

/// x to the right, y down.
using SvgPoint = std::pair<double, double>;

/// A drawing before it is a document: elements, and how much room they take.
struct SvgPicture {
  double width{};
  double height{};
  std::string body;
};

/// For text and attributes of SVG and HTML. What XML cannot hold (control characters) becomes '?'.
[[nodiscard]] std::string svg_escaped(std::string_view text);

/// @param anchor  start, middle or end
/// @param more    attributes
[[nodiscard]] std::string svg_text(double x, double y, const char* anchor, const std::string& what,
                                   int size, const std::string& more = {});

/// @param style  attributes, e.g. stroke="#333"
[[nodiscard]] std::string svg_line(double x1, double y1, double x2, double y2,
                                   const std::string& style);
[[nodiscard]] std::string svg_box(double x, double y, double width, double height,
                                  const std::string& style);
[[nodiscard]] std::string svg_polyline(std::span<const SvgPoint> points, const std::string& style);
[[nodiscard]] std::string svg_polygon(std::span<const SvgPoint> points, const std::string& style);

/// A document that stands alone: scales to where it is shown, on white.
[[nodiscard]] std::string svg_document(const SvgPicture& picture);

/// One below the other.
[[nodiscard]] SvgPicture svg_stacked(std::span<const SvgPicture> pictures);

/// How wide a text is, roughly: fonts differ.
[[nodiscard]] double svg_text_width(std::string_view text, int size);

}  // namespace fiducap
