#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

[[nodiscard]] inline std::string_view text_of_bytes(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Reads numbers from untrusted bytes. Never reads past the end: after the first short read all
/// reads return zero, and `check()` reports the number of bytes requested and left.
template <std::endian Order>
class ByteReader final {
 public:
  explicit ByteReader(std::span<const std::byte> in) : in_(in) {}

  std::uint8_t u8() { return get<std::uint8_t>(); }
  std::uint16_t u16() { return get<std::uint16_t>(); }
  std::uint32_t u32() { return get<std::uint32_t>(); }
  std::uint64_t u64() { return get<std::uint64_t>(); }
  std::int16_t i16() { return static_cast<std::int16_t>(get<std::uint16_t>()); }
  std::int32_t i32() { return static_cast<std::int32_t>(get<std::uint32_t>()); }
  std::int64_t i64() { return static_cast<std::int64_t>(get<std::uint64_t>()); }
  float f32() { return std::bit_cast<float>(get<std::uint32_t>()); }
  double f64() { return std::bit_cast<double>(get<std::uint64_t>()); }
  /// @return the next n bytes; empty when there are fewer
  std::span<const std::byte> bytes(std::size_t n) {
    if (!has(n)) return {};
    const auto taken = in_.subspan(at_, n);
    at_ += n;
    return taken;
  }

  [[nodiscard]] std::size_t left() const { return in_.size() - at_; }
  [[nodiscard]] bool failed() const { return failed_; }
  [[nodiscard]] Expected<void> check(const std::string& context) const {
    if (!failed_) return {};
    return fail(ErrorCode::kTruncated,
                "needs " + std::to_string(requested_) + " bytes at offset " + std::to_string(at_) +
                    ", only " + std::to_string(left()) + " left",
                context);
  }

 private:
  bool has(std::size_t n) {
    if (failed_) return false;
    if (n <= left()) return true;
    failed_ = true;
    requested_ = n;
    return false;
  }
  template <std::unsigned_integral U>
  U get() {
    constexpr std::size_t n = sizeof(U);
    if (!has(n)) return 0;
    U v = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t shift = Order == std::endian::big ? n - 1 - i : i;
      v = static_cast<U>(v | static_cast<U>(static_cast<U>(in_[at_ + i]) << (8 * shift)));
    }
    at_ += n;
    return v;
  }

  std::span<const std::byte> in_;
  std::size_t at_{0};
  std::size_t requested_{0};
  bool failed_{false};
};

using BigEndianReader = ByteReader<std::endian::big>;
using LittleEndianReader = ByteReader<std::endian::little>;

/// Appends numbers in one byte order to a byte vector of the caller.
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
