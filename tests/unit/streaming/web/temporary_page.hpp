#pragma once

#include "support/temporary_folder.hpp"

namespace fiducap::web {

/// A small bundle in a temporary folder, with a file beside it.
class TemporaryPage final {
 public:
  TemporaryPage() {
    write("page/index.html", "<!doctype html><title>page</title>");
    write("page/assets/index-1a2b.js", "export {};\n");
    write("secret.txt", "outside of the page");
  }
  void write(const std::string& name, const std::string& content) const {
    folder_.write(name, content);
  }
  [[nodiscard]] std::filesystem::path root() const { return folder_.path() / "page"; }
  [[nodiscard]] std::filesystem::path outside() const { return folder_.path(); }

 private:
  TemporaryFolder folder_;
};

}  // namespace fiducap::web
