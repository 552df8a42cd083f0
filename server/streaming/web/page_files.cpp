#include "streaming/web/page_files.hpp"

#include <array>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <optional>
#include <sstream>
#include <system_error>

#include "base/log.hpp"

namespace fiducap::web {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostFiles = 200;
constexpr std::uintmax_t kMostBytes = 32u << 20;

struct ContentType {
  std::string_view extension;
  std::string_view type;
};
constexpr std::array<ContentType, 9> kTypes{{{".html", "text/html; charset=utf-8"},
                                             {".js", "text/javascript; charset=utf-8"},
                                             {".css", "text/css; charset=utf-8"},
                                             {".svg", "image/svg+xml"},
                                             {".png", "image/png"},
                                             {".ico", "image/x-icon"},
                                             {".json", "application/json"},
                                             {".woff2", "font/woff2"},
                                             {".txt", "text/plain; charset=utf-8"}}};

std::optional<std::string_view> type_of(const fs::path& file) {
  const std::string extension = file.extension().string();
  for (const auto& known : kTypes) {
    if (known.extension == extension) return known.type;
  }
  return std::nullopt;
}

// FNV-1a: tells two builds of a page apart, nothing more is asked of it.
std::string etag_of(const std::string& content) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : content) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  std::array<char, 24> text{};
  std::snprintf(text.data(), text.size(), "\"%016llx\"", static_cast<unsigned long long>(hash));
  return text.data();
}

std::optional<std::string> read(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream content;
  content << file.rdbuf();
  if (!file) return std::nullopt;
  return content.str();
}

}  // namespace

PageFiles PageFiles::load(const fs::path& root) {
  PageFiles page;
  std::error_code error;
  std::uintmax_t bytes = 0;
  for (fs::recursive_directory_iterator at(root, error), end; !error && at != end;
       at.increment(error)) {
    const auto type = type_of(at->path());
    if (!type || !fs::is_regular_file(at->symlink_status(error))) continue;
    bytes += fs::file_size(at->path(), error);
    if (error || page.files_.size() == kMostFiles || bytes > kMostBytes) {
      log::warning(
          "web", "page folder " + root.string() + " is larger than a page: the rest is not served");
      break;
    }
    auto content = read(at->path());
    if (!content) continue;
    PageFile file;
    file.content_type = *type;
    file.etag = etag_of(*content);
    file.content = make_content(std::move(*content), Effort::kBest);
    const std::string name = "/" + at->path().lexically_relative(root).generic_string();
    file.never_changes = name.rfind("/assets/", 0) == 0;
    page.files_.emplace(name, std::move(file));
  }
  if (page.files_.find("/index.html") == page.files_.end()) page.files_.clear();
  return page;
}

const PageFile* PageFiles::find(std::string_view path) const {
  const auto found = files_.find(path == "/" ? std::string_view("/index.html") : path);
  return found == files_.end() ? nullptr : &found->second;
}

fs::path page_root(const std::string& configured) {
  if (!configured.empty()) return configured;
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  const fs::path packaged = folder / ".." / "share" / "fiducap" / "web";
  return fs::exists(packaged / "index.html", error) ? packaged : folder / "web";
}

}  // namespace fiducap::web
