#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"

namespace fiducap::qualisys {

/// What a settings packet says about one body.
struct BodySwitch {
  std::string name;
  bool enabled{true};
};

/// Takes `<The_6D><Body><Name>…</Name><Enabled>…</Enabled>…</Body>…</The_6D>` out of a settings
/// packet; bodies that do not say `Enabled` are left out, everything else is skipped.
/// @return Error when the text is no XML that we can follow, or names more than 1000 bodies
[[nodiscard]] Expected<std::vector<BodySwitch>> parse_body_switches(std::string_view xml);

}  // namespace fiducap::qualisys
