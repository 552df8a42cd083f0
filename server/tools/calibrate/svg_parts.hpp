#pragma once

#include <string>

namespace fiducap {

inline constexpr const char* kSvgInk = "#333";

/// For text and attributes.
[[nodiscard]] std::string svg_escaped(const std::string& text);

/// @param anchor  start, middle or end
[[nodiscard]] std::string svg_text(double x, double y, const char* anchor, const std::string& what,
                                   int size);

/// @param style  attributes, e.g. stroke="#333"
[[nodiscard]] std::string svg_line(double x1, double y1, double x2, double y2,
                                   const std::string& style);
[[nodiscard]] std::string svg_box(double x, double y, double width, double height,
                                  const std::string& style);

}  // namespace fiducap
