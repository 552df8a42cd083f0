#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"

namespace fiducap {

inline constexpr std::size_t kShortestToken = 8;

struct OperatorConfig {
  std::string token;       ///< Whoever knows it may change things; empty: nobody may.
  std::string token_file;  ///< Holds the token instead.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// The operator's token as a file: one line, printable characters, at least `kShortestToken`.
/// The file must belong to root or to whom the server runs as, and be closed to all others; its
/// group may read it. An empty file has an empty token: nobody is the operator.
/// @return Error naming the file and what to do.
[[nodiscard]] Expected<std::string> read_token_file(const std::string& path);

/// The token to be used: `token`, else of `token_file`, else of the credential `token` that a
/// service manager handed over.
/// @param credentials  folder of such credentials ($CREDENTIALS_DIRECTORY); may be null
[[nodiscard]] Expected<std::string> operator_token(const OperatorConfig& config,
                                                   const char* credentials);

}  // namespace fiducap
