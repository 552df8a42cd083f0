#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace fiducap::web {

/// A small bundle in a folder of its own, gone with the test.
class TemporaryPage final {
 public:
  TemporaryPage() {
    std::string pattern = (std::filesystem::temp_directory_path() / "fiducap-page-XXXXXX").string();
    root_ = ::mkdtemp(pattern.data());
    write("page/index.html", "<!doctype html><title>page</title>");
    write("page/assets/index-1a2b.js", "export {};\n");
    write("secret.txt", "outside of the page");
  }
  ~TemporaryPage() {
    std::error_code ignored;
    std::filesystem::remove_all(root_, ignored);
  }
  TemporaryPage(const TemporaryPage&) = delete;
  TemporaryPage& operator=(const TemporaryPage&) = delete;

  void write(const std::string& name, const std::string& content) const {
    std::filesystem::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name, std::ios::binary) << content;
  }
  [[nodiscard]] std::filesystem::path root() const { return root_ / "page"; }
  [[nodiscard]] std::filesystem::path outside() const { return root_; }

 private:
  std::filesystem::path root_;
};

}  // namespace fiducap::web
