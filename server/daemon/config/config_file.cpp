#include "daemon/config/config_file.hpp"

#include <algorithm>
#include <filesystem>

#include "base/whole_file.hpp"
#include "base/yaml_text.hpp"
#include "daemon/config/config_override.hpp"
#include "daemon/config/config_printer.hpp"
#include "daemon/config/config_reader.hpp"
#include "daemon/config/server_schema.hpp"

namespace fiducap {

namespace {

ConfigResult<YAML::Node> parse_yaml(const std::string& text, const std::string& name) {
  auto document = load_yaml(text);
  if (document) return document->IsNull() ? YAML::Node(YAML::NodeType::Map) : *document;
  const YamlFault& fault = document.error();
  ConfigError error{fault.path, fault.value, fault.rule};
  if (fault.path.empty()) error = {"file", name, fault.rule};
  return tl::unexpected(
      std::vector{ConfigFault{std::move(error), name + ":" + std::to_string(fault.line)}});
}

void number_the_bodies(std::vector<BodyConfig>& bodies) {
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (bodies[i].id == 0) bodies[i].id = static_cast<int>(i) + 1;
  }
}

/// A body that says nothing of a source for all, but names those of its sensors, means just these.
void choose_sources(const YAML::Node& bodies, ServerConfig& config) {
  if (!bodies || !bodies.IsSequence()) return;
  for (std::size_t i = 0; i < std::min(bodies.size(), config.bodies.size()); ++i) {
    const YAML::Node body = bodies[i];
    if (!body.IsMap() || body["source"]) continue;
    const auto& cameras = config.bodies[i].cameras;
    const bool names_some = std::any_of(cameras.begin(), cameras.end(), [](const auto& camera) {
      return camera.source.has_value();
    });
    if (names_some || config.bodies[i].imu_source)
      config.bodies[i].source.type = SourceType::kSensors;
  }
}

void choose_refinement(const YAML::Node& document, ServerConfig& config) {
  const YAML::Node map = document["map"];
  const bool is_said = map && map.IsMap() && map["refine_period_s"];
  if (!is_said) config.map.builder.refine_period_s = refine_period_for(config.bodies.size());
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
  number_the_bodies(read.bodies);
  if (document->IsMap()) {
    choose_refinement(*document, read);
    const YAML::Node& written = *document;
    choose_sources(written["bodies"], read);
  }
  for (auto& error : check(read)) {
    // A value that could not even be read keeps its default: whatever rule that breaks is not the
    // user's fault.
    const bool said =
        std::any_of(reading.faults.begin(), reading.faults.end(),
                    [&](const ConfigFault& fault) { return fault.error.path == error.path; });
    std::string where = reading.where(error.path);
    if (!said) reading.faults.push_back({std::move(error), std::move(where)});
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
  ServerConfig copy = config;  // visitors see members as theirs to change
  ConfigPrinter printer;
  describe(printer, copy);
  return printer.text();
}

}  // namespace fiducap
