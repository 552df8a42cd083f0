#include "architecture/source_files.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <set>
#include <string_view>

namespace fiducap::test {

namespace fs = std::filesystem;

std::vector<std::string> lines_of(const fs::path& path) {
  std::ifstream file(fs::path(FIDUCAP_SOURCE_DIR) / path);
  EXPECT_TRUE(file) << path;
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

std::vector<SourceFile> source_files(std::initializer_list<const char*> folders) {
  static const std::set<fs::path> kExtensions{".c", ".h", ".cpp", ".hpp"};
  std::vector<SourceFile> files;
  const fs::path root = FIDUCAP_SOURCE_DIR;
  for (const char* folder : folders) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      if (!kExtensions.contains(entry.path().extension())) continue;
      files.push_back({entry.path().lexically_relative(root), lines_of(entry.path())});
    }
  }
  std::sort(files.begin(), files.end(),
            [](const SourceFile& a, const SourceFile& b) { return a.path < b.path; });
  return files;
}

std::string code_of(const std::string& line) { return line.substr(0, line.find("//")); }

std::string included_by(const std::string& line) {
  constexpr std::string_view kInclude = "#include \"";
  if (!line.starts_with(kInclude)) return "";
  return line.substr(kInclude.size(), line.rfind('"') - kInclude.size());
}

}  // namespace fiducap::test
