#pragma once

#include <string>

#include <yaml-cpp/yaml.h>

#include "daemon/config/config_reader.hpp"

namespace fiducap {

/// Writes one `path.to.key=value` into the document, before anything is checked; a key that no
/// struct knows is found by the reader then. What cannot be applied becomes a fault.
void apply_override(YAML::Node& document, const std::string& assignment, Reading& reading);

}  // namespace fiducap
