#include "detection/sheet/pdf_document.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

namespace fiducap {
namespace {

std::vector<PdfPage> two_pages() {
  std::vector<PdfPage> pages{{210, 297}, {25.4, 50.8}};
  pages[0].fill({{25.4, 50.8, 12.7, 6.35}});
  pages[0].text({10, 20}, 3, "a (b) \\ \xC3\xA9");
  pages[1].line({0, 0}, {25.4, 0}, 1);
  return pages;
}

TEST(PdfDocument, CrossReferenceTableNamesTheByteWhereEachObjectBegins) {
  const std::string pdf = to_pdf(two_pages(), "t");
  const std::size_t table = std::strtoul(pdf.c_str() + pdf.find("startxref\n") + 10, nullptr, 10);
  ASSERT_EQ(pdf.compare(table, 9, "xref\n0 9\n"), 0) << pdf.substr(table, 20);
  const std::size_t first = table + 9;
  EXPECT_EQ(pdf.substr(first, 20), "0000000000 65535 f \n");
  for (std::size_t object = 1; object < 9; ++object) {
    const std::string entry = pdf.substr(first + 20 * object, 20);
    EXPECT_EQ(entry.substr(10), " 00000 n \n");
    const std::size_t offset = std::strtoul(entry.c_str(), nullptr, 10);
    const std::string begin = std::to_string(object) + " 0 obj\n";
    EXPECT_EQ(pdf.compare(offset, begin.size(), begin), 0) << "object " << object;
  }
}

TEST(PdfDocument, StreamLengthsAreTheBytesBetweenTheKeywords) {
  const std::string pdf = to_pdf(two_pages(), "t");
  int streams = 0;
  for (std::size_t at = pdf.find("/Length "); at != std::string::npos;
       at = pdf.find("/Length ", at + 1), ++streams) {
    const std::size_t length = std::strtoul(pdf.c_str() + at + 8, nullptr, 10);
    const std::size_t begin = pdf.find("stream\n", at) + 7;
    EXPECT_EQ(pdf.compare(begin + length, 9, "endstream"), 0);
  }
  EXPECT_EQ(streams, 2);
}

TEST(PdfDocument, MillimetresBecomePoints) {
  const std::vector<PdfPage> pages = two_pages();
  EXPECT_NE(pages[0].content().find("72.00000 144.00000 36.00000 18.00000 re\nf\n"),
            std::string::npos);
  EXPECT_NE(to_pdf(pages, "t").find("/MediaBox [ 0 0 72.00000 144.00000 ]"), std::string::npos);
}

TEST(PdfDocument, TextCannotBreakOutOfItsString) {
  EXPECT_NE(two_pages()[0].content().find("(a \\(b\\) \\\\ ?"
                                          "?) Tj"),
            std::string::npos);
}

}  // namespace
}  // namespace fiducap
