#pragma once

#include <string>

namespace fiducap {

/// The families libapriltag knows: `tag36h11`, `tag25h9`, `tag16h5`, …
[[nodiscard]] bool is_tag_family(const std::string& name);
/// For messages: all names, comma separated.
[[nodiscard]] std::string tag_family_names();

}  // namespace fiducap
