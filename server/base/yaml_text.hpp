#pragma once

#include <string>
#include <tl/expected.hpp>

#include <yaml-cpp/yaml.h>

namespace fiducap {

/// Why a text is not taken as YAML.
struct YamlFault {
  int line{};         ///< From 1; 0: not known.
  std::string path;   ///< e.g. `bodies.0`; empty: the whole text.
  std::string value;  ///< What stands there; may be empty.
  std::string rule;   ///< e.g. `repeats the section that it stands in`

  [[nodiscard]] std::string text() const;
};

/// The first document of a text that anybody may have written. Aliases (`*name`) are taken, but not
/// inside of what they repeat, and not so many that a short text becomes an endless one.
[[nodiscard]] tl::expected<YAML::Node, YamlFault> load_yaml(const std::string& text);

}  // namespace fiducap
