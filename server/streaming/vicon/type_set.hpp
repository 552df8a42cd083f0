#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "streaming/vicon/protocol.hpp"

namespace fiducap::vicon {

/// Where a type stands in kOffered; nothing for one that we do not send.
[[nodiscard]] constexpr std::optional<std::size_t> index_of(std::uint32_t type) {
  for (std::size_t i = 0; i < kOffered.size(); ++i) {
    if (static_cast<std::uint32_t>(kOffered[i]) == type) return i;
  }
  return std::nullopt;
}

/// Some of the offered types.
class TypeSet final {
 public:
  constexpr TypeSet() = default;

  /// A type that is not offered is left out.
  constexpr void add(std::uint32_t type) {
    if (const auto i = index_of(type)) bits_ |= 1u << *i;
  }
  [[nodiscard]] constexpr bool has(Type type) const {
    const auto i = index_of(static_cast<std::uint32_t>(type));
    return i && (bits_ >> *i & 1u) != 0;
  }
  [[nodiscard]] constexpr std::size_t size() const {
    std::size_t n = 0;
    for (std::uint32_t left = bits_; left != 0; left &= left - 1) ++n;
    return n;
  }
  [[nodiscard]] static constexpr TypeSet all() {
    TypeSet set;
    for (const Type type : kOffered) set.add(static_cast<std::uint32_t>(type));
    return set;
  }

  friend constexpr bool operator==(TypeSet, TypeSet) = default;
  friend constexpr TypeSet operator|(TypeSet a, TypeSet b) {
    a.bits_ |= b.bits_;
    return a;
  }

 private:
  std::uint32_t bits_{0};  ///< Bit i: kOffered[i].
};

}  // namespace fiducap::vicon
