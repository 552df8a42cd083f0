#pragma once

#include <string>

#include <yaml-cpp/yaml.h>

#include "base/yaml_section.hpp"

namespace fiducap {

/// Writes one `path.to.key=value` into the document, before anything is checked; a key that no
/// struct knows is found by the reader then. What cannot be applied becomes a fault.
void apply_override(YAML::Node& document, const std::string& assignment, YamlReading& reading);

}  // namespace fiducap
