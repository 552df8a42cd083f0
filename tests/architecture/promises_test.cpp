// docs/promises.md names the tests of each promise: all of them exist. No page is unfinished.
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <set>
#include <string>

#include "architecture/source_files.hpp"

namespace fiducap::test {
namespace {

/// The first groups of all matches, joined by a dot if there are two.
std::set<std::string> all_matches(const std::string& text, const std::regex& pattern) {
  std::set<std::string> found;
  for (std::sregex_iterator it(text.begin(), text.end(), pattern), end; it != end; ++it)
    found.insert((*it)[1].str() + (it->size() > 2 ? "." + (*it)[2].str() : ""));
  return found;
}

/// `Suite.Name` of every TEST, TEST_F and TEST_P below tests/.
std::set<std::string> all_tests() {
  static const std::regex kTest(R"(TEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\))");
  std::set<std::string> names;
  for (const SourceFile& file : source_files({"tests"})) {
    std::string text;
    for (const std::string& line : file.lines) text += line + "\n";
    names.merge(all_matches(text, kTest));
  }
  return names;
}

TEST(Promises, NameTestsThatExist) {
  static const std::regex kNamed(R"(`(\w+\.\w+)`)");
  const std::set<std::string> tests = all_tests();
  int promises = 0;
  for (const std::string& line : lines_of("docs/promises.md")) {
    if (!line.starts_with("| ") || line.starts_with("| guarantee ")) continue;
    ++promises;
    const auto named = all_matches(line.substr(line.find('|', 1)), kNamed);
    EXPECT_FALSE(named.empty()) << "no test holds: " << line;
    for (const std::string& name : named)
      EXPECT_TRUE(tests.contains(name)) << "there is no test " << name;
  }
  EXPECT_GT(promises, 20);
}

TEST(Documents, AreFinished) {
  static const std::regex kPlaceholder(R"(@[A-Z_]{4,}@|\bTODO\b|\bTBD\b)");
  int pages = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(std::string(FIDUCAP_SOURCE_DIR) + "/docs")) {
    if (entry.path().extension() != ".md") continue;
    ++pages;
    for (const std::string& line : lines_of(entry.path()))
      EXPECT_FALSE(std::regex_search(line, kPlaceholder)) << entry.path() << ": " << line;
  }
  EXPECT_GT(pages, 20);
}

}  // namespace
}  // namespace fiducap::test
