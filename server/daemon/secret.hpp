#pragma once

#include <string>
#include <string_view>

namespace fiducap {

/// 128 random bits from the kernel, hexadecimal.
[[nodiscard]] std::string fresh_secret();

/// Compares every byte: the time says nothing about the first wrong one. An empty secret admits
/// nothing.
[[nodiscard]] bool is_secret(std::string_view said, std::string_view secret);

}  // namespace fiducap
