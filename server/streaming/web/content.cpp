#include "streaming/web/content.hpp"

#include <zlib.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <system_error>
#include <utility>

#include "base/log.hpp"
#include "base/whole_file.hpp"
#include "streaming/conventions/text_fields.hpp"

namespace fiducap::web {

namespace {

constexpr int kGzipWrapper = 16;       // zlib: with gzip's header and checksum
constexpr int kMemoryLevel = 8;        // zlib's default
constexpr std::size_t kWorthIt = 512;  // shorter texts fit into one packet

std::optional<std::string> compressed(const std::string& text, Effort effort) {
  if (text.size() < kWorthIt || text.size() > std::numeric_limits<uInt>::max()) return std::nullopt;
  z_stream stream{};
  const int level = effort == Effort::kBest ? Z_BEST_COMPRESSION : Z_BEST_SPEED;
  if (deflateInit2(&stream, level, Z_DEFLATED, MAX_WBITS + kGzipWrapper, kMemoryLevel,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    return std::nullopt;
  std::string out(deflateBound(&stream, static_cast<uLong>(text.size())), '\0');
  // zlib does not write there.
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const int ended = deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  // Not worth it for less than a tenth, e.g. of pictures.
  if (ended != Z_STREAM_END || out.size() > text.size() / 10 * 9) return std::nullopt;
  return out;
}

/// `q=0`, `q=0.000`: not accepted.
bool is_refused(std::string_view parameters) {
  const auto q = parameters.find("q=");
  if (q == std::string_view::npos) return false;
  const std::string_view value = trimmed(parameters.substr(q + 2), " \t");
  return value.find_first_not_of("0.") == std::string_view::npos;
}

namespace fs = std::filesystem;

constexpr std::size_t kMostFiles = 200;
constexpr std::uintmax_t kMostBytes = 32u << 20;

struct ContentType {
  std::string_view extension;
  std::string_view type;
};
constexpr std::array<ContentType, 9> kTypes{{
    {".html", "text/html; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".ico", "image/x-icon"},
    {".json", "application/json"},
    {".woff2", "font/woff2"},
    {".txt", "text/plain; charset=utf-8"},
}};

std::optional<std::string_view> type_of(const fs::path& file) {
  const std::string extension = file.extension().string();
  for (const auto& known : kTypes)
    if (known.extension == extension) return known.type;
  return std::nullopt;
}

// FNV-1a: distinguishes builds of the page.
std::string etag_of(const std::string& content) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : content) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  std::array<char, 24> text{};
  std::snprintf(text.data(), text.size(), "\"%016llx\"", static_cast<unsigned long long>(hash));
  return text.data();
}

}  // namespace

Content plain_content(std::string text) {
  return {std::make_shared<const std::string>(std::move(text))};
}

Content make_content(std::string text, Effort effort) {
  auto shorter = compressed(text, effort);
  Content content = plain_content(std::move(text));
  if (shorter) content.gzip = std::make_shared<const std::string>(std::move(*shorter));
  return content;
}

bool accepts_gzip(std::string_view accept_encoding) {
  while (!accept_encoding.empty()) {
    const auto comma = accept_encoding.find(',');
    const std::string_view one = accept_encoding.substr(0, comma);
    accept_encoding.remove_prefix(comma == std::string_view::npos ? one.size() : comma + 1);
    const auto semicolon = one.find(';');
    if (!same_word(trimmed(one.substr(0, semicolon), " \t"), "gzip")) continue;
    return semicolon == std::string_view::npos || !is_refused(one.substr(semicolon + 1));
  }
  return false;
}

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
    auto content = read_whole_file(at->path().string(), kMostBytes);
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
