#pragma once

#include <filesystem>
#include <string>

#include "tools/terminal.hpp"

namespace fiducap {

/// What stands at `path` from an earlier time is kept beside it, as `path.before` (`.before2`, …
/// where there is one already), and that is said: it may be of another camera. Nothing is there:
/// nothing is done.
inline void keep_before(const std::string& path, const Terminal& terminal) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure)) return;
  std::string kept = path + ".before";
  for (int n = 2; std::filesystem::exists(kept, failure); ++n)
    kept = path + ".before" + std::to_string(n);
  std::filesystem::rename(path, kept, failure);
  if (!failure) terminal.err << path << " of an earlier time is kept as " << kept << "\n";
}

}  // namespace fiducap
