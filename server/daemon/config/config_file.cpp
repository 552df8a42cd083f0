#include "daemon/config/config_file.hpp"

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "base/whole_file.hpp"
#include "daemon/config/config_visitors.hpp"
#include "daemon/config/server_schema.hpp"

namespace fiducap {
namespace {

std::vector<std::string> split(const std::string& path) {
  std::vector<std::string> parts;
  std::istringstream stream(path);
  for (std::string part; std::getline(stream, part, '.');) parts.push_back(part);
  return parts;
}

/// Moves `at` to its child; creates sections, never list entries.
Broken descend(YAML::Node& at, const std::string& part) {
  if (at.IsSequence()) {
    std::size_t index{};
    if (!parse_number(part, index) || index >= at.size())
      return "the list has " + std::to_string(at.size()) +
             " entries, counted from 0; there is no `" + part + "`";
    at.reset(at[index]);
    return std::nullopt;
  }
  if (at.IsScalar()) return "`" + part + "` is below something that is not a section";
  at.reset(at[part]);
  return std::nullopt;
}

/// Writes one `path.to.key=value` into the document, before it is checked; the reader finds unknown
/// keys later. What cannot be applied becomes a fault.
void apply_override(YAML::Node& document, const std::string& assignment, YamlReading& reading) {
  const auto equals = assignment.find('=');
  const std::string path = assignment.substr(0, equals);
  const auto broken = [&](const std::string& value, const std::string& rule) {
    reading.faults.push_back({{path, value, rule}, "--set"});
  };
  const auto parts = split(path);
  if (equals == std::string::npos || parts.empty())
    return broken("?", "must be written path.to.key=value");
  if (path == "operator" || path == "operator.token" || path == "operator.read_token")
    return broken("(secret)",
                  "must not be on a command line, which every user of the machine sees: set "
                  "operator.token_file or operator.read_token_file");
  const std::string value = assignment.substr(equals + 1);
  YAML::Node parsed(value);
  if (!value.empty()) {
    auto loaded = load_yaml(value);
    if (!loaded) return broken(value, loaded.error().text());
    parsed = std::move(*loaded);
  }
  YAML::Node at = document;
  for (const auto& part : parts)
    if (const auto rule = descend(at, part)) return broken(value, *rule);
  at = parsed;
  reading.overridden.insert(path);
}

ConfigResult<YAML::Node> parse_yaml(const std::string& text, const std::string& name) {
  auto document = load_yaml(text);
  if (document) return document->IsNull() ? YAML::Node(YAML::NodeType::Map) : *document;
  const YamlFault& fault = document.error();
  ConfigError error{fault.path, fault.value, fault.rule};
  if (fault.path.empty()) error = {"file", name, fault.rule};
  return tl::unexpected(
      std::vector{ConfigFault{std::move(error), name + ":" + std::to_string(fault.line)}});
}

/// A body without `source` whose sensors have sources of their own has type kSensors.
void choose_sources(const YAML::Node& bodies, ServerConfig& config) {
  if (!bodies || !bodies.IsSequence()) return;
  for (std::size_t i = 0; i < std::min(bodies.size(), config.bodies.size()); ++i) {
    const YAML::Node body = bodies[i];
    if (!body.IsMap() || body["source"]) continue;
    const auto& cameras = config.bodies[i].cameras;
    const bool names_some =
        std::ranges::any_of(cameras, [](const auto& camera) { return camera.source.has_value(); });
    if (names_some || config.bodies[i].imu_source)
      config.bodies[i].source.type = SourceType::kSensors;
  }
}

}  // namespace

ConfigResult<ServerConfig> parse_config(const std::string& text, const std::string& name,
                                        const std::vector<std::string>& sets) {
  auto document = parse_yaml(text, name);
  if (!document) return tl::unexpected(document.error());
  const auto shared = std::make_shared<YamlReading>(
      YamlReading{name, std::filesystem::path(name).parent_path().string()});
  YamlReading& reading = *shared;
  if (document->IsMap()) {
    for (const auto& set : sets) apply_override(*document, set, reading);
  }
  ServerConfig read;
  ConfigReader::read_all(YamlSection(*document, "", shared), read);
  for (std::size_t i = 0; i < read.bodies.size(); ++i)
    if (read.bodies[i].id == 0) read.bodies[i].id = static_cast<int>(i) + 1;
  if (const YAML::Node& written = *document; written.IsMap()) {
    choose_sources(written["bodies"], read);
  }
  for (auto& error : check(read)) {
    // A value that could not be read has its default, whose faults are not the user's.
    const bool is_reported = std::ranges::any_of(
        reading.faults, [&](const ConfigFault& fault) { return fault.error.path == error.path; });
    std::string where = reading.where(error.path);
    if (!is_reported) reading.faults.push_back({std::move(error), std::move(where)});
  }
  if (!reading.faults.empty()) return tl::unexpected(std::move(reading.faults));
  return read;
}

ConfigResult<ServerConfig> load_config(const std::string& file,
                                       const std::vector<std::string>& sets) {
  if (file.empty()) return parse_config("", "defaults", sets);
  std::error_code failure;
  Expected<std::string> text = fail(ErrorCode::kInvalid, "is a folder", file);
  if (!std::filesystem::is_directory(file, failure)) text = read_whole_file(file);
  if (text && !text->empty()) return parse_config(*text, file, sets);
  return tl::unexpected(
      std::vector{ConfigFault{{"file", file, text ? "is empty" : text.error().what}, ""}});
}

std::string print_config(const ServerConfig& config) {
  ServerConfig copy = config;  // visitors may change members
  ConfigPrinter printer;
  describe(printer, copy);
  return printer.text();
}

}  // namespace fiducap
