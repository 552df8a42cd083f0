#include "streaming/web/page_files.hpp"

#include <gtest/gtest.h>

#include "temporary_page.hpp"

namespace fiducap::web {
namespace {

TEST(PageFiles, LinksOutOfTheFolderAreNotFollowed) {
  const TemporaryPage files;
  std::filesystem::create_symlink(files.outside() / "secret.txt", files.root() / "link.txt");
  std::filesystem::create_directory_symlink(files.outside(), files.root() / "up");
  const auto page = PageFiles::load(files.root());
  EXPECT_NE(page.find("/index.html"), nullptr);
  EXPECT_EQ(page.find("/link.txt"), nullptr);
  EXPECT_EQ(page.find("/up/secret.txt"), nullptr);
}

TEST(PageFiles, UnknownKindsOfFilesAreNotServed) {
  const TemporaryPage files;
  files.write("page/.npmrc", "x");
  files.write("page/tool.sh", "x");
  const auto page = PageFiles::load(files.root());
  EXPECT_EQ(page.find("/.npmrc"), nullptr);
  EXPECT_EQ(page.find("/tool.sh"), nullptr);
}

TEST(PageFiles, FolderWithoutIndexIsNoPage) {
  const TemporaryPage files;
  std::filesystem::remove(files.root() / "index.html");
  EXPECT_TRUE(PageFiles::load(files.root()).empty());
}

TEST(PageFiles, EndlesslyLargeFolderIsCut) {
  const TemporaryPage files;
  for (int i = 0; i < 300; ++i) files.write("page/n" + std::to_string(i) + ".txt", "x");
  int served = 0;
  const auto page = PageFiles::load(files.root());
  for (int i = 0; i < 300; ++i) served += page.find("/n" + std::to_string(i) + ".txt") != nullptr;
  EXPECT_LE(served, 200);
}

TEST(PageFiles, EtagFollowsTheContent) {
  const TemporaryPage files;
  const std::string before = PageFiles::load(files.root()).find("/index.html")->etag;
  EXPECT_EQ(PageFiles::load(files.root()).find("/")->etag, before);
  files.write("page/index.html", "<!doctype html><title>newer</title>");
  EXPECT_NE(PageFiles::load(files.root()).find("/")->etag, before);
}

TEST(PageRoot, ConfiguredFolderWinsElseBesideTheProgram) {
  EXPECT_EQ(page_root("/srv/page"), "/srv/page");
  EXPECT_EQ(page_root("").filename(), "web");
}

}  // namespace
}  // namespace fiducap::web
