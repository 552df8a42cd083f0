// The programs in the client's README are files that every build compiles, or that a test runs.
#include <gmock/gmock.h>

#include <fstream>
#include <sstream>

namespace {

std::string content(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(FIDUCAP_SOURCE_DIR + ("/client/" + path)).rdbuf();
  return text.str();
}

/// The code blocks of one language in the README.
std::vector<std::string> blocks(const std::string& language) {
  const std::string text = content("README.md");
  std::vector<std::string> found;
  const std::string opening = "```" + language + "\n";
  for (auto at = text.find(opening); at != std::string::npos; at = text.find(opening, at)) {
    at += opening.size();
    found.push_back(text.substr(at, text.find("```", at) - at));
  }
  return found;
}

TEST(ClientReadme, ShowsExamplesThatAreCompiledOrRun) {
  EXPECT_THAT(blocks("cpp"), testing::ElementsAre(content("examples/readme_example.cpp"),
                                                  content("examples/readme_control.cpp"),
                                                  content("examples/readme_events.cpp")));
  EXPECT_THAT(blocks("python"), testing::ElementsAre(content("python/examples/print_poses.py")));
}

}  // namespace
