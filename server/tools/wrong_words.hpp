#pragma once

#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace fiducap {

/// A verb or an option that there is not, with the one that was likely meant: CLI11 would complain
/// of arguments that were not expected, or of others that are missing.
/// @return what to say; nullopt: all of them are known
[[nodiscard]] std::optional<std::string> wrong_word(const CLI::App& app, int argc,
                                                    const char* const* argv);

}  // namespace fiducap
