#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace fiducap {

/// What of a log could not be read.
struct LogDamage {
  std::optional<std::uint64_t> cut_at{};  ///< Bytes that are whole, where the file ends early.
  std::uint64_t parts{0};                 ///< Left out.
  std::string first{};                    ///< What was wrong with the first of them.

  void note(std::string what) {
    if (parts++ == 0) first = std::move(what);
  }
  /// For people; nothing when all was read.
  void tell(std::uint64_t file_bytes, std::vector<std::string>& remarks) const {
    if (cut_at)
      remarks.push_back("is cut: of " + std::to_string(file_bytes) + " bytes the first " +
                        std::to_string(*cut_at) + " are whole, and were read");
    if (parts > 0)
      remarks.push_back("has " + std::to_string(parts) +
                        " damaged parts, which were left out; the first: " + first);
  }
};

}  // namespace fiducap
