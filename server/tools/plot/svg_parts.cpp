#include "tools/plot/svg_parts.hpp"

#include <algorithm>

#include "base/text.hpp"

namespace fiducap {
namespace {

std::string joined(std::span<const SvgPoint> points) {
  std::string out;
  for (const SvgPoint& p : points)
    out += (out.empty() ? "" : " ") + fixed(p.first, 1) + "," + fixed(p.second, 1);
  return out;
}

}  // namespace

std::string svg_escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else if (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t')
      out += '?';
    else
      out += c;
  }
  return out;
}

std::string svg_text(double x, double y, const char* anchor, const std::string& what, int size,
                     const std::string& more) {
  return "<text x=\"" + fixed(x, 1) + "\" y=\"" + fixed(y, 1) + "\" text-anchor=\"" + anchor +
         "\" font-size=\"" + std::to_string(size) + "\" fill=\"" + kSvgInk + "\"" +
         (more.empty() ? "" : " " + more) + ">" + svg_escaped(what) + "</text>\n";
}

std::string svg_line(double x1, double y1, double x2, double y2, const std::string& style) {
  return "<line x1=\"" + fixed(x1, 1) + "\" y1=\"" + fixed(y1, 1) + "\" x2=\"" + fixed(x2, 1) +
         "\" y2=\"" + fixed(y2, 1) + "\" " + style + "/>\n";
}

std::string svg_box(double x, double y, double width, double height, const std::string& style) {
  return "<rect x=\"" + fixed(x, 1) + "\" y=\"" + fixed(y, 1) + "\" width=\"" + fixed(width, 1) +
         "\" height=\"" + fixed(height, 1) + "\" " + style + "/>\n";
}

std::string svg_polyline(std::span<const SvgPoint> points, const std::string& style) {
  return "<polyline points=\"" + joined(points) + "\" " + style + "/>\n";
}

std::string svg_polygon(std::span<const SvgPoint> points, const std::string& style) {
  return "<polygon points=\"" + joined(points) + "\" " + style + "/>\n";
}

std::string svg_document(const SvgPicture& picture) {
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + fixed(picture.width, 0) +
         " " + fixed(picture.height, 0) + "\" font-family=\"sans-serif\">\n" +
         svg_box(0, 0, picture.width, picture.height, std::string("fill=\"") + kSvgPaper + "\"") +
         picture.body + "</svg>\n";
}

SvgPicture svg_stacked(std::span<const SvgPicture> pictures) {
  SvgPicture all;
  for (const SvgPicture& one : pictures) {
    all.body +=
        "<g transform=\"translate(0 " + fixed(all.height, 1) + ")\">\n" + one.body + "</g>\n";
    all.width = std::max(all.width, one.width);
    all.height += one.height;
  }
  return all;
}

double svg_text_width(std::string_view text, int size) {
  // Bytes that go on with a letter are none.
  const auto letters =
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; });
  return 0.56 * size * static_cast<double>(letters);
}

}  // namespace fiducap
