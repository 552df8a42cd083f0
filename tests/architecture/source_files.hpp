#pragma once

#include <filesystem>
#include <initializer_list>
#include <string>
#include <vector>

namespace fiducap::test {

/// One of our C or C++ files, as text.
struct SourceFile {
  std::filesystem::path path;  ///< From the project's root, e.g. `server/base/time.hpp`.
  std::vector<std::string> lines;

  [[nodiscard]] bool is_header() const {
    return path.extension() == ".hpp" || path.extension() == ".h";
  }
  /// `server/base/time.hpp:12`
  [[nodiscard]] std::string place(std::size_t line) const {
    return path.string() + ":" + std::to_string(line + 1);
  }
};

/// All source files below these folders, in the order of paths.
[[nodiscard]] std::vector<SourceFile> source_files(std::initializer_list<const char*> folders);

/// The lines of a file that must exist. @param path  absolute, or from the project's root
[[nodiscard]] std::vector<std::string> lines_of(const std::filesystem::path& path);

/// The line without its `//` comment.
[[nodiscard]] std::string code_of(const std::string& line);

/// `base/time.hpp` of `#include "base/time.hpp"`; empty for any other line.
[[nodiscard]] std::string included_by(const std::string& line);

}  // namespace fiducap::test
