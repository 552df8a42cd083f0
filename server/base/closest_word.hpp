#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace fiducap {

/// The word that was most likely meant: few letters are other ones, missing, too many or swapped
/// with their neighbour; case, `-`, `_` and blanks are the same.
/// @return nullopt when none is near
[[nodiscard]] std::optional<std::string> closest_word(std::string_view written,
                                                      std::span<const std::string> known);
/// `did you mean X?`, or nothing.
[[nodiscard]] std::string did_you_mean(std::string_view written,
                                       std::span<const std::string> known);
/// `must be one of a, b; did you mean b?`
[[nodiscard]] std::string must_be_one_of(std::span<const std::string> known,
                                         std::string_view written);

}  // namespace fiducap
