#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"

namespace fiducap {

inline constexpr std::size_t kShortestToken = 8;

struct OperatorConfig {
  std::string token;       ///< Proves an operator; empty: there is no operator.
  std::string token_file;  ///< Holds the token instead.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// Reads a token file: one line, printable characters, at least `kShortestToken`. The file must
/// belong to root or to the user of the server, and be closed to all others; its group may read it.
/// An empty file has an empty token.
/// @return Error naming the file and the remedy
[[nodiscard]] Expected<std::string> read_token_file(const std::string& path);

/// `token`, else of `token_file`, else the credential `token` of the service manager.
/// @param credentials  folder of such credentials ($CREDENTIALS_DIRECTORY); may be null
[[nodiscard]] Expected<std::string> operator_token(const OperatorConfig& config,
                                                   const char* credentials);

/// 128 random bits from the kernel, hexadecimal.
[[nodiscard]] std::string fresh_secret();

/// Compares in constant time. An empty secret admits nothing.
[[nodiscard]] bool is_secret(std::string_view given, std::string_view secret);

}  // namespace fiducap
