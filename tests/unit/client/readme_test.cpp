// The programs in the client's README are files that every build compiles, or that a test runs.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace {

std::string content(const std::string& path) {
  std::ifstream file(std::string(FIDUCAP_SOURCE_DIR) + path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// The code blocks of one language, in order.
std::vector<std::string> blocks(const std::string& text, const std::string& language) {
  std::vector<std::string> found;
  const std::string opening = "```" + language + "\n";
  for (auto at = text.find(opening); at != std::string::npos; at = text.find(opening, at)) {
    at += opening.size();
    found.push_back(text.substr(at, text.find("```", at) - at));
  }
  return found;
}

TEST(ClientReadme, ShowsTheExamplesThatAreCompiled) {
  EXPECT_EQ(blocks(content("/client/README.md"), "cpp"),
            (std::vector<std::string>{content("/client/examples/readme_example.cpp"),
                                      content("/client/examples/readme_control.cpp"),
                                      content("/client/examples/readme_events.cpp")}));
}

TEST(ClientReadme, ShowsThePythonExampleThatIsRun) {
  EXPECT_EQ(blocks(content("/client/README.md"), "python"),
            (std::vector<std::string>{content("/client/python/examples/print_poses.py")}));
}

}  // namespace
