#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

namespace fiducap {

/// Appends numbers to a byte vector in one byte order. The vector is the caller's, so its capacity
/// is reused.
template <std::endian Order>
class ByteWriter final {
 public:
  explicit ByteWriter(std::vector<std::byte>& out) : out_(out) {}

  ByteWriter& u8(std::uint8_t v) { return put(v); }
  ByteWriter& u16(std::uint16_t v) { return put(v); }
  ByteWriter& u32(std::uint32_t v) { return put(v); }
  ByteWriter& u64(std::uint64_t v) { return put(v); }
  ByteWriter& i16(std::int16_t v) { return put(static_cast<std::uint16_t>(v)); }
  ByteWriter& i32(std::int32_t v) { return put(static_cast<std::uint32_t>(v)); }
  ByteWriter& i64(std::int64_t v) { return put(static_cast<std::uint64_t>(v)); }
  ByteWriter& f32(float v) { return put(std::bit_cast<std::uint32_t>(v)); }
  ByteWriter& f64(double v) { return put(std::bit_cast<std::uint64_t>(v)); }
  ByteWriter& bytes(std::span<const std::byte> v) {
    out_.insert(out_.end(), v.begin(), v.end());
    return *this;
  }
  ByteWriter& text(std::string_view v) {
    return bytes(std::as_bytes(std::span(v.data(), v.size())));
  }
  ByteWriter& zeros(std::size_t n) {
    out_.insert(out_.end(), n, std::byte{0});
    return *this;
  }

 private:
  template <std::unsigned_integral U>
  ByteWriter& put(U v) {
    constexpr std::size_t n = sizeof(U);
    std::byte raw[n];
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t shift = Order == std::endian::big ? n - 1 - i : i;
      raw[i] = static_cast<std::byte>((v >> (8 * shift)) & 0xff);
    }
    return bytes(raw);
  }

  std::vector<std::byte>& out_;
};

using BigEndianWriter = ByteWriter<std::endian::big>;
using LittleEndianWriter = ByteWriter<std::endian::little>;

}  // namespace fiducap
