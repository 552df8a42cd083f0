#include "streaming/natnet/peer.hpp"

#include <arpa/inet.h>

#include <charconv>

namespace fiducap::natnet {

std::optional<std::uint32_t> parse_address(const std::string& text) {
  in_addr parsed{};
  if (::inet_pton(AF_INET, text.c_str(), &parsed) != 1) return std::nullopt;
  return ntohl(parsed.s_addr);
}

std::optional<Peer> parse_peer(const std::string& text) {
  const auto colon = text.rfind(':');
  if (colon == std::string::npos) return std::nullopt;
  const auto address = parse_address(text.substr(0, colon));
  std::uint16_t port = 0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data() + colon + 1, end, port);
  if (!address || error != std::errc{} || rest != end || port == 0) return std::nullopt;
  return Peer{*address, port};
}

std::string text_of(const Peer& peer) {
  std::string text;
  for (int shift = 24; shift >= 0; shift -= 8) {
    text += std::to_string(peer.address >> shift & 0xff) + (shift > 0 ? "." : "");
  }
  return text + ":" + std::to_string(peer.port);
}

}  // namespace fiducap::natnet
