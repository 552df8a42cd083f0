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
  std::string token_file;  ///< Holds the token instead. Read again when it changes.
  /// Needed to read pages, `/api/v1`, `/metrics` and camera views; empty: reading needs none.
  std::string read_token;
  std::string read_token_file;  ///< Holds it instead. Read again when it changes.
  std::string audit_file;       ///< JSON lines of all changes; empty: only in the log.

  [[nodiscard]] std::vector<ConfigError> check() const;
};

/// Reads a token file: one line, printable characters, at least `kShortestToken`. The file must
/// belong to root or to the user of the server, and be closed to all others; its group may read it.
/// An empty file has an empty token.
/// @return Error naming the file and the remedy
[[nodiscard]] Expected<std::string> read_token_file(const std::string& path);

/// Each token: as configured, else of its file, else the credential `token` or `read_token` of the
/// service manager.
/// @param credentials  folder of such credentials ($CREDENTIALS_DIRECTORY); may be null
[[nodiscard]] Expected<OperatorConfig> with_tokens(OperatorConfig config, const char* credentials);

}  // namespace fiducap
