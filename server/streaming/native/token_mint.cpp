#include "streaming/native/token_mint.hpp"

#include <algorithm>

namespace fiducap::native {

namespace {

template <typename T>
std::uint8_t* put(std::uint8_t* at, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    *at++ = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * i));
  }
  return at;
}

}  // namespace

std::uint64_t TokenMint::token(const Peer& peer, Instant now) const {
  return token_of_period(peer, to_ns(now) / period_.count());
}

bool TokenMint::accepts(std::uint64_t token, const Peer& peer, Instant now) const {
  const std::int64_t period = to_ns(now) / period_.count();
  return token == token_of_period(peer, period) || token == token_of_period(peer, period - 1);
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
