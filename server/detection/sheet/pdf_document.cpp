#include "detection/sheet/pdf_document.hpp"

#include <array>
#include <charconv>
#include <cstdio>

namespace fiducap {
namespace {

constexpr double kPointsPerMm = 72.0 / 25.4;

// std::to_chars does not depend on the locale.
std::string points(double mm) {
  std::array<char, 64> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), mm * kPointsPerMm,
                                 std::chars_format::fixed, 5);
  return {text.data(), end.ptr};
}

std::string pair(PdfPage::Point at) { return points(at.x) + " " + points(at.y); }

std::string literal(std::string_view words) {
  std::string text = "(";
  for (const char c : words) {
    if (c == '(' || c == ')' || c == '\\') text += '\\';
    text += c >= ' ' && c <= '~' ? c : '?';
  }
  return text + ")";
}

/// Collects the numbered objects with their offsets.
class ObjectWriter final {
 public:
  void add(std::string_view body) {
    offsets_.push_back(file_.size());
    file_ += std::to_string(offsets_.size()) + " 0 obj\n";
    file_ += body;
    file_ += "\nendobj\n";
  }
  /// The cross-reference table: entries of exactly 20 bytes, PDF 1.4 section 3.4.3.
  std::string finish() {
    const std::size_t table = file_.size();
    const std::string count = std::to_string(offsets_.size() + 1);
    file_ += "xref\n0 " + count + "\n0000000000 65535 f \n";
    for (const std::size_t offset : offsets_) {
      std::array<char, 32> entry{};
      std::snprintf(entry.data(), entry.size(), "%010zu 00000 n \n", offset);
      file_ += entry.data();
    }
    file_ += "trailer\n<< /Size " + count + " /Root 1 0 R /Info 4 0 R >>\nstartxref\n" +
             std::to_string(table) + "\n%%EOF\n";
    return std::move(file_);
  }

 private:
  std::string file_{"%PDF-1.4\n%\xE2\xE3\xCF\xD3\n"};
  std::vector<std::size_t> offsets_;
};

}  // namespace

void PdfPage::fill(const std::vector<Rectangle>& rectangles) {
  for (const Rectangle& r : rectangles)
    content_ += pair({r.x, r.y}) + " " + pair({r.width, r.height}) + " re\n";
  if (!rectangles.empty()) content_ += "f\n";
}

void PdfPage::fill_polygon(const std::vector<Point>& corners) {
  for (std::size_t i = 0; i < corners.size(); ++i)
    content_ += pair(corners[i]) + (i == 0 ? " m\n" : " l\n");
  if (!corners.empty()) content_ += "h f\n";
}

void PdfPage::line(Point from, Point to, double thickness_mm) {
  content_ += points(thickness_mm) + " w " + pair(from) + " m " + pair(to) + " l S\n";
}

void PdfPage::text(Point at, double height_mm, std::string_view words) {
  content_ +=
      "BT /F1 " + points(height_mm) + " Tf " + pair(at) + " Td " + literal(words) + " Tj ET\n";
}

std::string to_pdf(const std::vector<PdfPage>& pages, std::string_view title) {
  constexpr std::size_t kFirstPageObject = 5;  // after catalog, page list, font and title
  ObjectWriter objects;
  objects.add("<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>");
  std::string kids;
  for (std::size_t i = 0; i < pages.size(); ++i)
    kids += std::to_string(kFirstPageObject + 2 * i) + " 0 R ";
  objects.add("<< /Type /Pages /Count " + std::to_string(pages.size()) + " /Kids [ " + kids +
              "] >>");
  objects.add("<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>");
  objects.add("<< /Title " + literal(title) + " /Producer (Fiducap) >>");
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const PdfPage& page = pages[i];
    objects.add("<< /Type /Page /Parent 2 0 R /MediaBox [ 0 0 " +
                pair({page.width_mm(), page.height_mm()}) +
                " ] /Resources << /Font << /F1 3 0 R >> >> /Contents " +
                std::to_string(kFirstPageObject + 2 * i + 1) + " 0 R >>");
    objects.add("<< /Length " + std::to_string(page.content().size()) + " >>\nstream\n" +
                page.content() + "endstream");
  }
  return objects.finish();
}

}  // namespace fiducap
