// The program in the client's README is the one that every build compiles.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>

namespace {

std::string content(const std::string& path) {
  std::ifstream file(std::string(FIDUCAP_SOURCE_DIR) + path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(ClientReadme, ShowsTheExampleThatIsCompiled) {
  const std::string readme = content("/client/README.md");
  const std::string opening = "```cpp\n";
  const auto from = readme.find(opening);
  ASSERT_NE(from, std::string::npos);
  const auto code = from + opening.size();
  EXPECT_EQ(readme.substr(code, readme.find("```", code) - code), content("/client/examples/readme_example.cpp"));
}

}  // namespace
