#include "middleware/net/peer.hpp"

#include <arpa/inet.h>
#include <sys/random.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>

#include "base/text.hpp"

namespace fiducap::net {

namespace {

constexpr std::array<std::uint8_t, 12> kMappedIPv4{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};

struct SipState {
  std::uint64_t v0, v1, v2, v3;

  void round() {
    v0 += v1;
    v1 = std::rotl(v1, 13) ^ v0;
    v0 = std::rotl(v0, 32);
    v2 += v3;
    v3 = std::rotl(v3, 16) ^ v2;
    v0 += v3;
    v3 = std::rotl(v3, 21) ^ v0;
    v2 += v1;
    v1 = std::rotl(v1, 17) ^ v2;
    v2 = std::rotl(v2, 32);
  }
  void absorb(std::uint64_t word) {
    v3 ^= word;
    round();
    round();
    v0 ^= word;
  }
};

std::uint64_t little_endian_word(std::span<const std::uint8_t> bytes) {
  std::uint64_t word = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) word |= std::uint64_t{bytes[i]} << (8 * i);
  return word;
}

}  // namespace

bool Peer::is_ipv4() const {
  return std::equal(kMappedIPv4.begin(), kMappedIPv4.end(), address.begin());
}

bool Peer::is_loopback() const {
  if (is_ipv4()) return address[12] == 127;
  return address[15] == 1 && std::all_of(address.begin(), address.end() - 1,
                                         [](std::uint8_t byte) { return byte == 0; });
}

std::optional<std::uint32_t> parse_address(const std::string& text) {
  in_addr parsed{};
  if (::inet_pton(AF_INET, text.c_str(), &parsed) != 1) return std::nullopt;
  return ntohl(parsed.s_addr);
}

bool is_address(const std::string& text) {
  in6_addr parsed{};
  const std::string without_scope = text.substr(0, text.find('%'));
  return parse_address(text) || ::inet_pton(AF_INET6, without_scope.c_str(), &parsed) == 1;
}

std::optional<Peer> parse_peer(const std::string& text) {
  const auto colon = text.rfind(':');
  if (colon == std::string::npos) return std::nullopt;
  const auto address = parse_address(text.substr(0, colon));
  std::uint16_t port = 0;
  if (!address || !parse_number(text.substr(colon + 1), port) || port == 0) return std::nullopt;
  return Peer{*address, port};
}

std::string address_text(const Peer& peer) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  const bool ipv4 = peer.is_ipv4();
  ::inet_ntop(ipv4 ? AF_INET : AF_INET6, peer.address.data() + (ipv4 ? kMappedIPv4.size() : 0),
              text.data(), text.size());
  std::string address = text.data();
  if (peer.scope != 0) address.append("%").append(std::to_string(peer.scope));
  return address;
}

std::string text_of(const Peer& peer) {
  const std::string address = address_text(peer);
  return (peer.is_ipv4() ? address : "[" + address + "]") + ":" + std::to_string(peer.port);
}

SocketAddress::SocketAddress(const sockaddr* address, socklen_t size)
    : size_(std::min(size, kCapacity)) {
  std::memcpy(&any_, address, size_);
}

SocketAddress::SocketAddress(const Peer& peer, bool ipv4) {
  if (ipv4) {
    any_.v4 = sockaddr_in{};
    any_.v4.sin_family = AF_INET;
    any_.v4.sin_port = htons(peer.port);
    any_.v4.sin_addr.s_addr = htonl(peer.ipv4());
    size_ = sizeof(sockaddr_in);
    return;
  }
  any_.v6.sin6_family = AF_INET6;
  any_.v6.sin6_port = htons(peer.port);
  any_.v6.sin6_scope_id = peer.scope;
  std::memcpy(&any_.v6.sin6_addr, peer.address.data(), peer.address.size());
}

Peer SocketAddress::peer() const {
  if (any_.general.sa_family == AF_INET)
    return {ntohl(any_.v4.sin_addr.s_addr), ntohs(any_.v4.sin_port)};
  Peer peer;
  std::memcpy(peer.address.data(), &any_.v6.sin6_addr, peer.address.size());
  peer.port = ntohs(any_.v6.sin6_port);
  peer.scope = peer.is_ipv4() ? 0 : any_.v6.sin6_scope_id;
  return peer;
}

std::uint64_t siphash(const std::array<std::uint64_t, 2>& key, std::span<const std::uint8_t> data) {
  SipState state{key[0] ^ 0x736f6d6570736575, key[1] ^ 0x646f72616e646f6d,
                 key[0] ^ 0x6c7967656e657261, key[1] ^ 0x7465646279746573};
  std::size_t at = 0;
  for (; at + 8 <= data.size(); at += 8) state.absorb(little_endian_word(data.subspan(at, 8)));
  state.absorb(little_endian_word(data.subspan(at)) | std::uint64_t{data.size()} << 56);
  state.v2 ^= 0xff;
  for (int i = 0; i < 4; ++i) state.round();
  return state.v0 ^ state.v1 ^ state.v2 ^ state.v3;
}

std::uint64_t random_word() {
  std::uint64_t word{};
  // Eight bytes are never cut off; a signal may end the wait for the first entropy.
  while (::getrandom(&word, sizeof word, 0) != sizeof word)
    if (errno != EINTR) throw std::system_error(errno, std::generic_category(), "getrandom");
  return word;
}

std::array<std::uint64_t, 2> random_key() { return {random_word(), random_word()}; }

std::string random_secret() {
  std::string secret;
  for (const std::uint64_t word : random_key()) {
    std::array<char, 17> digits{};
    std::snprintf(digits.data(), digits.size(), "%016llx", static_cast<unsigned long long>(word));
    secret += digits.data();
  }
  return secret;
}

std::uint64_t address_hash(const std::array<std::uint64_t, 2>& key, const Peer& peer) {
  return siphash(key, std::span(peer.address).first(peer.is_ipv4() ? 16 : 8));
}

std::uint64_t peer_hash(const std::array<std::uint64_t, 2>& key, const Peer& peer) {
  std::array<std::uint8_t, 18> input{};
  std::copy(peer.address.begin(), peer.address.end(), input.begin());
  input[16] = static_cast<std::uint8_t>(peer.port >> 8);
  input[17] = static_cast<std::uint8_t>(peer.port);
  return siphash(key, input);
}

}  // namespace fiducap::net
