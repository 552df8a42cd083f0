// How long files and lines may be (CONTRIBUTING.md). Functions: readability-function-size of
// clang-tidy.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "architecture/source_files.hpp"

namespace fiducap::test {
namespace {

constexpr std::size_t kLongestHeader = 200;
constexpr std::size_t kLongestSource = 400;
constexpr std::ptrdiff_t kLongestLine = 100;
constexpr std::size_t kMostSingleUserHeaders = 40;  // one fewer whenever one is merged

/// Templates have their sources in headers.
std::size_t longest(const SourceFile& file) {
  const bool source = !file.is_header() || file.path.stem().string().ends_with("_impl");
  return source ? kLongestSource : kLongestHeader;
}

/// In columns: the first byte of a UTF-8 character counts; combining accents (U+0300 …, of p̂) do
/// not.
std::ptrdiff_t width(const std::string& line) {
  return std::count_if(line.begin(), line.end(), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return (byte & 0xC0) != 0x80 && byte != 0xCC;
  });
}

TEST(Measures, FilesAndLinesAreShort) {
  for (const SourceFile& file : source_files({"server", "client", "proto", "tests"})) {
    EXPECT_LE(file.lines.size(), longest(file)) << file.path;
    for (std::size_t i = 0; i < file.lines.size(); ++i)
      EXPECT_LE(width(file.lines[i]), kLongestLine) << file.place(i);
  }
}

// A header with one user besides its own source belongs to that user.
TEST(Measures, FewHeadersHaveASingleUser) {
  std::map<std::string, std::set<std::string>> users;
  const auto files = source_files({"server"});
  for (const SourceFile& file : files) {
    for (const std::string& line : file.lines) {
      const std::string included = included_by(line);
      const std::string user = file.path.lexically_relative("server").replace_extension();
      if (std::filesystem::path(included).replace_extension() != user)
        users[included].insert(file.path.string());
    }
  }
  std::vector<std::string> single;
  for (const SourceFile& file : files) {
    if (!file.is_header()) continue;
    const std::string name = file.path.lexically_relative("server");
    if (users[name].size() < 2) single.push_back(name);
  }
  EXPECT_GT(single.size(), 0u) << "the test did not find the headers";
  EXPECT_LE(single.size(), kMostSingleUserHeaders) << ::testing::PrintToString(single);
}

}  // namespace
}  // namespace fiducap::test
