#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "daemon/setup/setup_guide.hpp"
#include "daemon/setup/setup_result.hpp"
#include "daemon/setup/setup_rig.hpp"

namespace fiducap {

/// The cameras of this machine.
[[nodiscard]] std::vector<FoundCamera> found_cameras();

/// Where the operator's token of a configuration stands: beside it, `robot.yaml` → `robot.token`.
[[nodiscard]] std::string token_file_of(const std::string& file);

/// The tags that a set-up needs, to be printed: PDF. @param order  `family`, `size_mm`, `paper`
[[nodiscard]] Expected<std::string> setup_sheet(const SetupCommand& order);

/// What write_setup writes.
[[nodiscard]] std::string setup_preview(const std::string& file, const SetupResult& result);

/// Could it be written there? Asked before a person takes the steps.
[[nodiscard]] Expected<void> can_write_setup(const std::string& file);

/// Writes the configuration, and a new operator's token beside it that only this user may read.
/// Both whole and then renamed.
/// @param replace  an existing file is written over
/// @return Error when there is one, or the result breaks a rule of configurations
[[nodiscard]] Expected<void> write_setup(const std::string& file, const SetupResult& result,
                                         bool replace);

}  // namespace fiducap
