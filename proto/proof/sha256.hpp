#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace fiducap::proof {

using Digest = std::array<std::uint8_t, 32>;

/// SHA-256 (FIPS 180-4) of bytes that come in pieces.
class Sha256 {
 public:
  Sha256();
  void add(const std::uint8_t* bytes, std::size_t size);
  /// Ends the object.
  Digest digest();

 private:
  void block(const std::uint8_t* bytes);

  std::array<std::uint32_t, 8> state_;
  std::array<std::uint8_t, 64> waiting_{};
  std::size_t waiting_size_{0};
  std::uint64_t size_{0};
};

/// HMAC (RFC 2104) over SHA-256.
class Hmac {
 public:
  Hmac(const std::uint8_t* key, std::size_t size);
  void add(const std::uint8_t* bytes, std::size_t size) { inner_.add(bytes, size); }
  /// Ends the object.
  Digest digest();

 private:
  Sha256 inner_;
  Sha256 outer_;
};

/// In a time that does not depend on where they differ.
bool equal(const Digest& a, const Digest& b);

}  // namespace fiducap::proof
