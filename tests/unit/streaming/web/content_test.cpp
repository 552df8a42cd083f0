#include <gtest/gtest.h>

#include <zlib.h>

#include <random>
#include <vector>

#include "streaming/web/content.hpp"
#include "temporary_page.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;

std::string inflated(const std::string& gzip) {
  z_stream stream{};
  std::string out(1 << 20, '\0');
  EXPECT_EQ(inflateInit2(&stream, MAX_WBITS + 16), Z_OK);
  std::vector<Bytef> in(gzip.begin(), gzip.end());
  stream.next_in = in.data();
  stream.avail_in = static_cast<uInt>(in.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  inflateEnd(&stream);
  return out;
}

TEST(Content, CompressedTextIsUnchanged) {
  std::string text;
  for (int i = 0; i < 5000; ++i) text += "{\"id\":" + std::to_string(i) + "},";
  for (const Effort effort : {Effort::kQuick, Effort::kBest}) {
    const Content content = make_content(text, effort);
    ASSERT_TRUE(content.gzip);
    EXPECT_LT(content.gzip->size() * 3, text.size());
    EXPECT_EQ(inflated(*content.gzip), text);
    EXPECT_EQ(*content.plain, text);
  }
}

TEST(Content, TextThatDoesNotGetShorterStaysPlain) {
  EXPECT_FALSE(make_content("{}", Effort::kBest).gzip);
  EXPECT_FALSE(make_content("", Effort::kBest).gzip);
  std::mt19937 random(3);
  std::string noise(5000, '\0');
  for (char& c : noise) c = static_cast<char>(random());
  EXPECT_FALSE(make_content(noise, Effort::kBest).gzip);
}

TEST(AcceptsGzip, OnlyWhereListedWithoutZeroQuality) {
  for (const char* header : {"gzip", "GZIP", "deflate, gzip", "gzip;q=0.5", "br;q=0 , gzip ; q=1"})
    EXPECT_TRUE(accepts_gzip(header)) << header;
  for (const char* header : {"", "identity", "gzip;q=0", "gzip; q=0.000", "xgzip", "br, deflate",
                             ",,,", ";q=1", "identity, gzip;q=0"})
    EXPECT_FALSE(accepts_gzip(header)) << header;
}

TEST(Prepared, IsMadeOncePerPeriodOnRequest) {
  Prepared prepared;
  int made = 0;
  const auto make = [&] { return std::to_string(++made); };
  const Instant start = instant_from_ns(1'000'000'000);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(*prepared.at(start, make).plain, "1");
  EXPECT_EQ(*prepared.at(start + Prepared::kPeriod - 1ms, make).plain, "1");
  EXPECT_EQ(*prepared.at(start + Prepared::kPeriod, make).plain, "2");
  EXPECT_EQ(*prepared.at(start + 1h, make).plain, "3");
}

TEST(PageFiles, ServesKnownKindsOfFilesInTheFolderOnly) {
  const TemporaryPage files;
  std::filesystem::create_symlink(files.outside() / "secret.txt", files.root() / "link.txt");
  std::filesystem::create_directory_symlink(files.outside(), files.root() / "up");
  files.write("page/.npmrc", "x");
  files.write("page/tool.sh", "x");
  const auto page = PageFiles::load(files.root());
  EXPECT_NE(page.find("/index.html"), nullptr);
  for (const char* target : {"/link.txt", "/up/secret.txt", "/.npmrc", "/tool.sh"})
    EXPECT_EQ(page.find(target), nullptr) << target;
  std::filesystem::remove(files.root() / "index.html");
  EXPECT_TRUE(PageFiles::load(files.root()).empty());
}

TEST(PageFiles, LimitsTheNumberOfFiles) {
  const TemporaryPage files;
  for (int i = 0; i < 300; ++i) files.write("page/n" + std::to_string(i) + ".txt", "x");
  int served = 0;
  const auto page = PageFiles::load(files.root());
  for (int i = 0; i < 300; ++i) served += page.find("/n" + std::to_string(i) + ".txt") != nullptr;
  EXPECT_LE(served, 200);
}

TEST(PageFiles, EtagChangesWithTheContent) {
  const TemporaryPage files;
  const std::string before = PageFiles::load(files.root()).find("/index.html")->etag;
  EXPECT_EQ(PageFiles::load(files.root()).find("/")->etag, before);
  files.write("page/index.html", "<!doctype html><title>newer</title>");
  EXPECT_NE(PageFiles::load(files.root()).find("/")->etag, before);
}

TEST(PageRoot, IsTheConfiguredFolderElseBesideTheProgram) {
  EXPECT_EQ(page_root("/srv/page"), "/srv/page");
  EXPECT_EQ(page_root("").filename(), "web");
}

}  // namespace
}  // namespace fiducap::web
