#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/expected.hpp"

namespace fiducap {

/// Reads numbers from bytes from outside. Never reads past the end: the first short read
/// makes the reader fail for good, later reads give zero, and `check()` says what was wanted and
/// what was left.
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
  /// @return the next n bytes, empty when there are fewer.
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
                "needs " + std::to_string(wanted_) + " bytes at offset " + std::to_string(at_) +
                    ", only " + std::to_string(left()) + " left",
                context);
  }

 private:
  bool has(std::size_t n) {
    if (failed_) return false;
    if (n <= left()) return true;
    failed_ = true;
    wanted_ = n;
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
  std::size_t wanted_{0};
  bool failed_{false};
};

using BigEndianReader = ByteReader<std::endian::big>;
using LittleEndianReader = ByteReader<std::endian::little>;

}  // namespace fiducap
