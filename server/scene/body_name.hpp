#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace fiducap {

/// In bytes; fits every protocol and the name of a folder.
inline constexpr std::size_t kMaxBodyName = 63;

/// Checks the name of a body: letters and digits of any script, single spaces, and _ - . + ( ).
/// Excludes characters that are special in a protocol, path, markup or shell, and lookalikes.
/// @return the broken rule, to follow the key and the name; nullopt: the name is valid
[[nodiscard]] std::optional<std::string> body_name_fault(std::string_view name);

/// Any bytes for one line of text: in quotes, invisible characters escaped as \x1b or \u202e.
[[nodiscard]] std::string shown_name(std::string_view name);

}  // namespace fiducap
