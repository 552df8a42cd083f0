#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace fiducap::natnet {

/// A command in words, taken apart: `SetProperty,drone,Name,arm` → word and three arguments.
struct Command {
  static constexpr std::size_t kMostArguments = 4;

  std::string_view word;
  std::array<std::string_view, kMostArguments> arguments{};  ///< The last one takes all that is left, commas too.
  std::size_t count{};

  /// Empty when there are fewer.
  [[nodiscard]] std::string_view operator[](std::size_t i) const { return i < count ? arguments[i] : std::string_view{}; }
};

/// Never fails: any text is a word. Blanks around word and arguments do not count.
[[nodiscard]] Command parse_command(std::string_view text);

}  // namespace fiducap::natnet
