#include "streaming/native/token_mint.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace fiducap::native {

namespace {

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

constexpr std::array<std::uint8_t, 12> kMappedIPv4{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};

template <typename T>
std::uint8_t* put(std::uint8_t* at, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    *at++ = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * i));
  }
  return at;
}

}  // namespace

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

std::uint64_t TokenMint::token(const Peer& peer, Instant now) const {
  return token_of_period(peer, to_ns(now) / period_.count());
}

bool TokenMint::accepts(std::uint64_t token, const Peer& peer, Instant now) const {
  const std::int64_t period = to_ns(now) / period_.count();
  return token == token_of_period(peer, period) || token == token_of_period(peer, period - 1);
}

std::uint64_t TokenMint::address_hash(const Peer& peer) const {
  const bool is_ipv4 = std::equal(kMappedIPv4.begin(), kMappedIPv4.end(), peer.address.begin());
  return siphash(key_, std::span(peer.address).first(is_ipv4 ? 16 : 8));
}

std::uint64_t TokenMint::token_of_period(const Peer& peer, std::int64_t period) const {
  std::array<std::uint8_t, 30> input{};
  auto* at = std::copy(peer.address.begin(), peer.address.end(), input.data());
  at = put(at, peer.scope);
  at = put(at, peer.port);
  put(at, period);
  return std::max<std::uint64_t>(1, siphash(key_, input));
}

}  // namespace fiducap::native
