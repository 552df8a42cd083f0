// docs/tests.md says which part of the tests each program belongs to; build/…/parts.txt says it as
// CMake knows it.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>

namespace fiducap::test {
namespace {

/// By part: the words in backquotes of its row.
std::map<std::string, std::set<std::string>> documented_parts() {
  static const std::regex kWord(R"(`(\w+)`)");
  std::ifstream file(std::string(FIDUCAP_SOURCE_DIR) + "/docs/tests.md");
  EXPECT_TRUE(file);
  std::map<std::string, std::set<std::string>> parts;
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("| `")) continue;
    std::sregex_iterator word(line.begin(), line.end(), kWord);
    auto& programs = parts[(*word)[1].str()];
    for (++word; word != std::sregex_iterator(); ++word) programs.insert((*word)[1].str());
  }
  return parts;
}

/// By part: its programs.
std::map<std::string, std::set<std::string>> built_parts() {
  std::ifstream file(std::string(FIDUCAP_BINARY_DIR) + "/parts.txt");
  EXPECT_TRUE(file);
  std::map<std::string, std::set<std::string>> parts;
  for (std::string part, program; file >> part >> program;) parts[part].insert(program);
  return parts;
}

TEST(Parts, EveryProgramThatIsNotQuickStandsInTheRowOfItsPart) {
  const auto documented = documented_parts();
  const auto built = built_parts();
  EXPECT_GT(built.size(), 5u);
  for (const auto& [part, programs] : built) {
    ASSERT_TRUE(documented.contains(part)) << part;
    if (part == "quick") continue;
    for (const std::string& program : programs)
      EXPECT_TRUE(documented.at(part).contains(program)) << program << " is of " << part;
  }
}

TEST(Parts, AProgramOfWhichQuickRunsAFewTestsIsNamedThere) {
  const auto documented = documented_parts();
  auto built = built_parts();
  const std::set<std::string> quick = built["quick"];
  built.erase("quick");
  for (const auto& [part, programs] : built) {
    for (const std::string& program : programs)
      EXPECT_EQ(quick.contains(program), documented.at("quick").contains(program)) << program;
  }
}

}  // namespace
}  // namespace fiducap::test
