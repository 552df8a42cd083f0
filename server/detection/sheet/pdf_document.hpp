#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace fiducap {

/// One page, drawn in millimetres from its lower-left corner. Black on white; PDF numbers are
/// points with five decimals (4 nm), so printed sizes are exact.
class PdfPage final {
 public:
  struct Rectangle {
    double x, y, width, height;
  };
  struct Point {
    double x, y;
  };

  PdfPage(double width_mm, double height_mm) : width_mm_(width_mm), height_mm_(height_mm) {}

  /// All rectangles as one filled path, which shows no hairline between touching ones.
  void fill(const std::vector<Rectangle>& rectangles);
  void fill_polygon(const std::vector<Point>& corners);
  void line(Point from, Point to, double thickness_mm);
  /// Helvetica, left-aligned at the base line. Replaces characters outside ASCII by '?'.
  void text(Point at, double height_mm, std::string_view words);

  [[nodiscard]] double width_mm() const { return width_mm_; }
  [[nodiscard]] double height_mm() const { return height_mm_; }
  [[nodiscard]] const std::string& content() const { return content_; }

 private:
  double width_mm_;
  double height_mm_;
  std::string content_;
};

/// The file: PDF 1.4, uncompressed, one built-in font; equal pages give equal bytes.
[[nodiscard]] std::string to_pdf(const std::vector<PdfPage>& pages, std::string_view title);

}  // namespace fiducap
