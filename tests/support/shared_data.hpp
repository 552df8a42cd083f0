#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>

namespace fiducap {

/// The folder with the large recordings: $FIDUCAP_DATA, else `../shared/data` beside the project.
/// Tests that need it are skipped without it: `GTEST_SKIP() << kNoSharedData`.
inline std::optional<std::filesystem::path> shared_data() {
  const char* named = std::getenv("FIDUCAP_DATA");
  const std::filesystem::path folder =
      named != nullptr ? std::filesystem::path(named)
                       : std::filesystem::path(FIDUCAP_SOURCE_DIR) / ".." / "shared" / "data";
  if (std::filesystem::exists(folder / "README.md"))
    return std::filesystem::weakly_canonical(folder);
  return std::nullopt;
}

inline constexpr const char* kNoSharedData =
    "the recordings are not here (set FIDUCAP_DATA or put them into ../shared/data): this test did "
    "not run";

}  // namespace fiducap
