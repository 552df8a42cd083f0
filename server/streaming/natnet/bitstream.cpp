#include "streaming/natnet/bitstream.hpp"

#include <algorithm>
#include <charconv>

namespace fiducap::natnet {

namespace {

constexpr std::size_t kMostParts = 4;

/// The newest that is not newer than `version`; the oldest for anything before it.
Bitstream round_down(Bitstream version) {
  const auto above = std::upper_bound(kBitstreams.begin(), kBitstreams.end(), version);
  return above == kBitstreams.begin() ? kOldest : *(above - 1);
}

/// One number 0..255 and what follows its dot.
std::optional<std::uint8_t> take_part(std::string_view& text) {
  const auto dot = text.find('.');
  const std::string_view part = text.substr(0, dot);
  std::uint8_t value = 0;
  const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
  if (part.empty() || error != std::errc{} || end != part.data() + part.size()) return std::nullopt;
  text = dot == std::string_view::npos ? std::string_view{} : text.substr(dot + 1);
  if (dot != std::string_view::npos && text.empty()) return std::nullopt;
  return value;
}

}  // namespace

std::string text_of(Bitstream version) {
  return std::to_string(version.major) + "." + std::to_string(version.minor);
}

std::optional<Bitstream> parse_bitstream(std::string_view text) {
  std::array<std::uint8_t, kMostParts> parts{};
  std::size_t n = 0;
  while (!text.empty()) {
    if (n == kMostParts) return std::nullopt;
    const auto part = take_part(text);
    if (!part) return std::nullopt;
    parts[n++] = *part;
  }
  if (n < 2) return std::nullopt;
  return Bitstream{parts[0], parts[1]};
}

bool is_supported(Bitstream version) {
  return std::find(kBitstreams.begin(), kBitstreams.end(), version) != kBitstreams.end();
}

Bitstream negotiate(const ClientVersions& client, Bitstream server_default) {
  if (client.wanted && *client.wanted != Bitstream{}) return round_down(*client.wanted);
  // A library reads the version it is told only up to its own: newer bytes crash it.
  if (client.library && client.library->major >= kOldest.major) {
    return round_down(std::min(server_default, *client.library));
  }
  return round_down(server_default);
}

FrameLayout frame_layout(Bitstream version) {
  if (version >= Bitstream{4, 1}) return FrameLayout::k4_1;
  if (version >= Bitstream{3, 0}) return FrameLayout::k3_0;
  if (version >= Bitstream{2, 9}) return FrameLayout::k2_9;
  if (version >= Bitstream{2, 7}) return FrameLayout::k2_7;
  if (version >= Bitstream{2, 6}) return FrameLayout::k2_6;
  return FrameLayout::k2_5;
}

ModelLayout model_layout(Bitstream version) {
  if (version >= Bitstream{4, 2}) return ModelLayout::k4_2;
  if (version >= Bitstream{4, 1}) return ModelLayout::k4_1;
  if (version >= Bitstream{4, 0}) return ModelLayout::k4_0;
  if (version >= Bitstream{3, 0}) return ModelLayout::k3_0;
  return ModelLayout::k2_5;
}

}  // namespace fiducap::natnet
