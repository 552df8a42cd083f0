#include "daemon/config/config_reader.hpp"

#include <algorithm>
#include <filesystem>

namespace fiducap {

namespace {

constexpr std::size_t kLongestValue = 80;

/// A value as it stands in a message: one line, not endless.
std::string shown(const YAML::Node& node) {
  if (node.IsMap() && node.size() > 0) return "{…}";
  if (node.IsSequence() && node.size() > 6) return "[…]";
  YAML::Emitter out;
  out << YAML::Flow << node;
  std::string text = out.c_str();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text.size() <= kLongestValue ? text : text.substr(0, kLongestValue) + "…";
}

bool is_file_name(const std::string& device) {
  const bool number =
      std::all_of(device.begin(), device.end(), [](char c) { return c >= '0' && c <= '9'; });
  return !number && device.find('!') == std::string::npos &&
         device.find("://") == std::string::npos;
}

}  // namespace

bool Reading::is_overridden(const std::string& path) const {
  return std::any_of(overridden.begin(), overridden.end(), [&](const std::string& set) {
    return path == set || path.rfind(set + ".", 0) == 0;
  });
}

std::string Reading::where(const std::string& path) const {
  for (std::string at = path; !at.empty();) {
    if (is_overridden(at)) return "--set";
    if (const auto found = places.find(at); found != places.end()) return found->second;
    const auto dot = at.rfind('.');
    at = dot == std::string::npos ? "" : at.substr(0, dot);
  }
  return file;
}

ConfigReader::ConfigReader(const YAML::Node& section, std::string path, Reading& reading)
    : section_(section), path_(std::move(path)), reading_(reading) {
  if (section_.IsMap() || section_.IsNull()) return;
  reading_.faults.push_back(
      {{path_.empty() ? "file" : path_, shown(section_), "must be a section of `key: value`"},
       reading_.where(path_)});
  section_ = YAML::Node(YAML::NodeType::Map);
}

YAML::Node ConfigReader::take(const char* key) {
  known_.emplace_back(key);
  if (!section_.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
  const YAML::Node& fixed = section_;  // operator[] of a const node does not insert
  YAML::Node node = fixed[key];
  if (!node.IsDefined()) return YAML::Node(YAML::NodeType::Undefined);
  if (!reading_.is_overridden(path_of(key))) {
    reading_.places[path_of(key)] = reading_.file + ":" + std::to_string(node.Mark().line + 1);
  }
  return node;
}

void ConfigReader::report(const std::string& key, const YAML::Node& node, const Broken& broken) {
  if (!broken) return;
  reading_.faults.push_back({{path_of(key), shown(node), *broken}, reading_.where(path_of(key))});
}

void ConfigReader::seconds(const char* key, Duration& out) {
  const YAML::Node node = take(key);
  double value{};
  if (!node.IsDefined()) return;
  const auto broken = read_value(node, value);
  report(key, node, broken);
  if (!broken) out = from_seconds(value);
}

void ConfigReader::path(const char* key, std::string& out) {
  const YAML::Node node = take(key);
  if (!node.IsDefined()) return;
  report(key, node, read_value(node, out));
  if (!out.empty()) out = resolved(path_of(key), out);
}

std::string ConfigReader::resolved(const std::string& path, const std::string& file) const {
  const std::filesystem::path base = reading_.is_overridden(path) ? "" : reading_.folder;
  return std::filesystem::absolute(base / file).lexically_normal().string();
}

void ConfigReader::device(const char* key, std::string& out) {
  const YAML::Node node = take(key);
  if (!node.IsDefined()) return;
  report(key, node, read_value(node, out));
  if (!out.empty() && is_file_name(out)) out = resolved(path_of(key), out);
}

void ConfigReader::finish() {
  if (!section_.IsMap()) return;
  std::set<std::string> given;
  for (const auto& entry : section_) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : shown(entry.first);
    std::string rule;
    if (std::find(known_.begin(), known_.end(), key) == known_.end()) {
      rule = "unknown key; known here are ";
      for (const auto& known : known_) rule += (known == known_.front() ? "" : ", ") + known;
    } else if (!given.insert(key).second) {
      rule = "is given twice";
    }
    if (rule.empty()) continue;
    const int line = entry.first.Mark().line + 1;
    const bool set = reading_.is_overridden(path_of(key));
    reading_.faults.push_back({{path_of(key), shown(entry.second), rule},
                               set ? "--set" : reading_.file + ":" + std::to_string(line)});
  }
}

}  // namespace fiducap
