#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace fiducap {

/// Short enough for every protocol, and for the name of a folder.
inline constexpr std::size_t kMaxBodyName = 63;

/// What a body may be called: letters and digits of any script, spaces between them, and _ - . + (
/// ). What is used for something else on some wire, in a path, in markup or by a shell, or what
/// looks like something that it is not, may not be in it.
/// @return what is wrong, to follow the name and its key; nothing: it is a name
[[nodiscard]] std::optional<std::string> body_name_fault(std::string_view name);

/// Any bytes as a line can show them: in quotes, with \x1b or \u202e for what would not be seen or
/// would change how the rest is.
[[nodiscard]] std::string shown_name(std::string_view name);

}  // namespace fiducap
