#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "streaming/web/content.hpp"

namespace fiducap::web {

/// One file of the bundled page, as it goes over the wire.
struct PageFile {
  Content content;
  std::string content_type;
  std::string etag;      ///< Of the content, with its quotes.
  bool never_changes{};  ///< Its name carries its content's hash.
};

/// The bundled page, read and compressed once at start. Serving is a look-up by exact name, so no
/// request can reach another file.
class PageFiles final {
 public:
  /// Regular files of known types under `root`, bounded in number and size; links are not followed.
  /// A folder without `index.html` gives an empty page.
  [[nodiscard]] static PageFiles load(const std::filesystem::path& root);

  [[nodiscard]] bool empty() const { return files_.empty(); }
  /// @param path  of a request, e.g. `/assets/index-4f2a.js`; `/` is the index
  [[nodiscard]] const PageFile* find(std::string_view path) const;

 private:
  std::map<std::string, PageFile, std::less<>> files_;
};

/// @param configured  from the configuration; empty: `web` or `../share/fiducap/web` beside the
/// running program
[[nodiscard]] std::filesystem::path page_root(const std::string& configured);

}  // namespace fiducap::web
