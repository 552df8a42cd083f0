#include "streaming/web/content.hpp"

#include <zlib.h>

#include <cctype>
#include <limits>
#include <utility>

namespace fiducap::web {

namespace {

constexpr int kGzipWrapper = 16;       // zlib: with gzip's header and checksum
constexpr int kMemoryLevel = 8;        // zlib's default
constexpr std::size_t kWorthIt = 512;  // shorter texts fit into one packet anyhow

std::optional<std::string> compressed(const std::string& text, Effort effort) {
  if (text.size() < kWorthIt || text.size() > std::numeric_limits<uInt>::max()) return std::nullopt;
  z_stream stream{};
  const int level = effort == Effort::kBest ? Z_BEST_COMPRESSION : Z_BEST_SPEED;
  if (deflateInit2(&stream, level, Z_DEFLATED, MAX_WBITS + kGzipWrapper, kMemoryLevel,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    return std::nullopt;
  std::string out(deflateBound(&stream, static_cast<uLong>(text.size())), '\0');
  // zlib's interface knows no const; it does not write there.
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const int ended = deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  // A picture is compressed already; a tenth is not worth the browser's work.
  if (ended != Z_STREAM_END || out.size() > text.size() / 10 * 9) return std::nullopt;
  return out;
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

bool same_word(std::string_view text, std::string_view word) {
  if (text.size() != word.size()) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (std::tolower(static_cast<unsigned char>(text[i])) != word[i]) return false;
  }
  return true;
}

/// `q=0`, `q=0.000`: anything but this one.
bool is_refused(std::string_view parameters) {
  const auto q = parameters.find("q=");
  if (q == std::string_view::npos) return false;
  const std::string_view value = trimmed(parameters.substr(q + 2));
  return value.find_first_not_of("0.") == std::string_view::npos;
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
    if (!same_word(trimmed(one.substr(0, semicolon)), "gzip")) continue;
    return semicolon == std::string_view::npos || !is_refused(one.substr(semicolon + 1));
  }
  return false;
}

}  // namespace fiducap::web
