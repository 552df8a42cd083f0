#include "daemon/config/config_override.hpp"

#include <charconv>
#include <optional>
#include <sstream>

#include "base/yaml_text.hpp"

namespace fiducap {

namespace {

std::vector<std::string> split(const std::string& path) {
  std::vector<std::string> parts;
  std::istringstream stream(path);
  for (std::string part; std::getline(stream, part, '.');) parts.push_back(part);
  return parts;
}

std::optional<std::size_t> index_of(const std::string& part) {
  std::size_t index{};
  const auto [end, failure] = std::from_chars(part.data(), part.data() + part.size(), index);
  if (failure != std::errc{} || end != part.data() + part.size()) return std::nullopt;
  return index;
}

/// Moves `at` to its child; creates sections, never list entries.
Broken descend(YAML::Node& at, const std::string& part) {
  if (at.IsSequence()) {
    const auto index = index_of(part);
    if (!index || *index >= at.size()) {
      return "the list has " + std::to_string(at.size()) +
             " entries, counted from 0; there is no `" + part + "`";
    }
    at.reset(at[*index]);
    return std::nullopt;
  }
  if (at.IsScalar()) return "`" + part + "` is below something that is not a section";
  at.reset(at[part]);
  return std::nullopt;
}

}  // namespace

void apply_override(YAML::Node& document, const std::string& assignment, YamlReading& reading) {
  const auto equals = assignment.find('=');
  const std::string path = assignment.substr(0, equals);
  const auto broken = [&](const std::string& value, const std::string& rule) {
    reading.faults.push_back({{path, value, rule}, "--set"});
  };
  const auto parts = split(path);
  if (equals == std::string::npos || parts.empty())
    return broken("?", "must be written path.to.key=value");
  const std::string value = assignment.substr(equals + 1);
  YAML::Node parsed(value);
  if (!value.empty()) {
    auto loaded = load_yaml(value);
    if (!loaded) return broken(value, loaded.error().text());
    parsed = std::move(*loaded);
  }
  YAML::Node at = document;
  for (const auto& part : parts) {
    if (const auto rule = descend(at, part)) return broken(value, *rule);
  }
  at = parsed;
  reading.overridden.insert(path);
}

}  // namespace fiducap
