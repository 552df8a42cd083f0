#include "daemon/secret.hpp"

#include <array>
#include <cstdio>

#include "middleware/net/peer.hpp"

namespace fiducap {

std::string fresh_secret() {
  const auto key = net::random_key();
  std::array<char, 33> text{};
  std::snprintf(text.data(), text.size(), "%016llx%016llx", static_cast<unsigned long long>(key[0]),
                static_cast<unsigned long long>(key[1]));
  return text.data();
}

bool is_secret(std::string_view said, std::string_view secret) {
  if (secret.empty() || said.size() != secret.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < said.size(); ++i)
    difference |= static_cast<unsigned char>(said[i]) ^ static_cast<unsigned char>(secret[i]);
  return difference == 0;
}

}  // namespace fiducap
