#include "proof/control_proof.hpp"

namespace fiducap::proof {

namespace {

const std::uint8_t* bytes_of(const std::string& text) {
  return reinterpret_cast<const std::uint8_t*>(text.data());
}

}  // namespace

Digest control_proof(const std::string& token, const std::string& challenge, std::uint64_t sequence,
                     const std::string& body) {
  constexpr char kPurpose[] = "fiducap control v1";  // with its closing zero
  std::array<std::uint8_t, 8> place{};
  for (std::size_t i = 0; i < place.size(); ++i)
    place[i] = static_cast<std::uint8_t>(sequence >> (8 * i));
  Hmac hmac(bytes_of(token), token.size());
  hmac.add(reinterpret_cast<const std::uint8_t*>(kPurpose), sizeof(kPurpose));
  hmac.add(bytes_of(challenge), challenge.size());
  hmac.add(place.data(), place.size());
  hmac.add(bytes_of(body), body.size());
  return hmac.digest();
}

}  // namespace fiducap::proof
