// docs/promises.md names the tests that hold each promise: all of them exist. No page was left
// unfinished.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "architecture/source_files.hpp"

namespace fiducap::test {
namespace {

/// `Suite.Name` of every TEST, TEST_F and TEST_P below tests/.
std::set<std::string> all_tests() {
  static const std::regex kTest(R"(TEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\))");
  std::set<std::string> names;
  for (const SourceFile& file : source_files({"tests"})) {
    std::string text;
    for (const std::string& line : file.lines) text += line + "\n";
    for (std::sregex_iterator it(text.begin(), text.end(), kTest), end; it != end; ++it)
      names.insert((*it)[1].str() + "." + (*it)[2].str());
  }
  return names;
}

/// Rows of the tables: what is promised, and the tests named in it.
struct Promise {
  std::string row;
  std::vector<std::string> tests;
};

std::vector<Promise> promises() {
  static const std::regex kNamed(R"(`(\w+\.\w+)`)");
  std::ifstream file(std::string(FIDUCAP_SOURCE_DIR) + "/docs/promises.md");
  EXPECT_TRUE(file);
  std::vector<Promise> all;
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("| ") || line.starts_with("| guarantee ")) continue;
    Promise promise{line, {}};
    const std::string held = line.substr(line.find('|', 1));
    for (std::sregex_iterator it(held.begin(), held.end(), kNamed), end; it != end; ++it)
      promise.tests.push_back((*it)[1].str());
    all.push_back(std::move(promise));
  }
  return all;
}

TEST(Promises, EachNamesTestsThatExist) {
  const std::set<std::string> tests = all_tests();
  const auto all = promises();
  EXPECT_GT(all.size(), 20u);
  for (const Promise& promise : all) {
    EXPECT_FALSE(promise.tests.empty()) << "nothing holds: " << promise.row;
    for (const std::string& name : promise.tests)
      EXPECT_TRUE(tests.contains(name)) << "there is no test " << name;
  }
}

TEST(Documents, AreFinished) {
  static const std::regex kPlaceholder(R"(@[A-Z_]{4,}@|\bTODO\b|\bTBD\b)");
  int pages = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(std::string(FIDUCAP_SOURCE_DIR) + "/docs")) {
    if (entry.path().extension() != ".md") continue;
    ++pages;
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);)
      EXPECT_FALSE(std::regex_search(line, kPlaceholder)) << entry.path() << ": " << line;
  }
  EXPECT_GT(pages, 20);
}

}  // namespace
}  // namespace fiducap::test
