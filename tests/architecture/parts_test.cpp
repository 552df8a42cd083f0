// docs/tests.md lists the programs of each part of the tests; build/…/parts.txt has them as CMake
// knows them.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>

#include "architecture/source_files.hpp"

namespace fiducap::test {
namespace {

using Parts = std::map<std::string, std::set<std::string>>;

/// By part: the words in backquotes of its row.
Parts documented_parts() {
  static const std::regex kWord(R"(`(\w+)`)");
  Parts parts;
  for (const std::string& line : lines_of("docs/tests.md")) {
    if (!line.starts_with("| `")) continue;
    std::sregex_iterator word(line.begin(), line.end(), kWord);
    auto& programs = parts[(*word)[1].str()];
    for (++word; word != std::sregex_iterator(); ++word) programs.insert((*word)[1].str());
  }
  return parts;
}

/// By part: its programs.
Parts built_parts() {
  std::ifstream file(std::string(FIDUCAP_BINARY_DIR) + "/parts.txt");
  EXPECT_TRUE(file);
  Parts parts;
  for (std::string part, program; file >> part >> program;) parts[part].insert(program);
  return parts;
}

// All programs but those of `quick`, and in the row of `quick` those of which it runs a few tests.
TEST(Parts, AreDocumentedWithTheirPrograms) {
  const Parts documented = documented_parts();
  Parts built = built_parts();
  EXPECT_GT(built.size(), 5u);
  for (const auto& entry : built) ASSERT_TRUE(documented.contains(entry.first)) << entry.first;
  const std::set<std::string> quick = built["quick"];
  built.erase("quick");
  for (const auto& [part, programs] : built) {
    for (const std::string& program : programs) {
      EXPECT_TRUE(documented.at(part).contains(program)) << program << " is of " << part;
      EXPECT_EQ(quick.contains(program), documented.at("quick").contains(program)) << program;
    }
  }
}

}  // namespace
}  // namespace fiducap::test
