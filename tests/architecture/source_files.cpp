#include "architecture/source_files.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <string_view>

namespace fiducap::test {

namespace fs = std::filesystem;

std::vector<SourceFile> source_files(std::initializer_list<const char*> folders) {
  static constexpr std::array<std::string_view, 4> kExtensions{".c", ".h", ".cpp", ".hpp"};
  std::vector<SourceFile> files;
  const fs::path root = FIDUCAP_SOURCE_DIR;
  for (const char* folder : folders) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      const std::string extension = entry.path().extension().string();
      if (std::find(kExtensions.begin(), kExtensions.end(), extension) == kExtensions.end()) {
        continue;
      }
      SourceFile& file = files.emplace_back();
      file.path = entry.path().lexically_relative(root);
      std::ifstream stream(entry.path());
      for (std::string line; std::getline(stream, line);) file.lines.push_back(line);
    }
  }
  std::sort(files.begin(), files.end(),
            [](const SourceFile& a, const SourceFile& b) { return a.path < b.path; });
  return files;
}

std::string code_of(const std::string& line) { return line.substr(0, line.find("//")); }

std::string included_by(const std::string& line) {
  constexpr std::string_view kInclude = "#include \"";
  if (line.rfind(kInclude, 0) != 0) return "";
  return line.substr(kInclude.size(), line.rfind('"') - kInclude.size());
}

}  // namespace fiducap::test
