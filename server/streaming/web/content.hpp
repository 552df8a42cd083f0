#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/time.hpp"

namespace fiducap::web {

/// The body of a reply, shared by all clients: plain and, if shorter, compressed.
struct Content {
  std::shared_ptr<const std::string> plain;
  std::shared_ptr<const std::string> gzip{};  ///< nullptr: not worth it.
};

/// Compression level: kBest at the start, kQuick while serving.
enum class Effort { kQuick, kBest };

[[nodiscard]] Content make_content(std::string text, Effort effort);
/// Not compressed.
[[nodiscard]] Content plain_content(std::string text);

/// @param accept_encoding  of a request, e.g. `gzip, deflate;q=0.5`
[[nodiscard]] bool accepts_gzip(std::string_view accept_encoding);

/// A reply that changes; made on request, at most once per period.
class Prepared final {
 public:
  static constexpr Duration kPeriod = std::chrono::milliseconds(250);

  /// @param make  gives the text
  template <typename Make>
  [[nodiscard]] const Content& at(Instant now, Make&& make) {
    if (!made_at_ || now - *made_at_ >= kPeriod || now < *made_at_) {
      content_ = make_content(make(), Effort::kQuick);
      made_at_ = now;
    }
    return content_;
  }

 private:
  std::optional<Instant> made_at_;
  Content content_;
};

/// One file of the page bundle, as sent.
struct PageFile {
  Content content;
  std::string content_type;
  std::string etag;      ///< Of the content, with its quotes.
  bool never_changes{};  ///< Its name has a hash of its content.
};

/// The page bundle, read and compressed at start. Files are found by exact name only.
class PageFiles final {
 public:
  /// Reads regular files of known types under `root`, bounded in number and size, without following
  /// links. Empty without `index.html`.
  [[nodiscard]] static PageFiles load(const std::filesystem::path& root);

  [[nodiscard]] bool empty() const { return files_.empty(); }
  /// @param path  of a request, e.g. `/assets/index-4f2a.js`; `/` is the index
  [[nodiscard]] const PageFile* find(std::string_view path) const;

 private:
  std::map<std::string, PageFile, std::less<>> files_;
};

/// @param configured  empty: `web` or `../share/fiducap/web` beside the running program
[[nodiscard]] std::filesystem::path page_root(const std::string& configured);

}  // namespace fiducap::web
