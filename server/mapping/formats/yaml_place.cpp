#include "mapping/formats/yaml_place.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <unordered_map>

#include "base/yaml_text.hpp"
#include "detection/tag_family_list.hpp"
#include "mapping/formats/map_doubts.hpp"
#include "mapping/formats/map_exchange.hpp"
#include "mapping/formats/text_number.hpp"

namespace fiducap {

namespace {

int line_in_text(const YAML::Node& node) {
  return node.Mark().is_null() ? 0 : node.Mark().line + 1;
}

std::string below(const std::string& path, std::string_view key) {
  return path.empty() ? std::string(key) : path + "." + std::string(key);
}

YamlValue value_of(const YAML::Node& node, const std::string& path);

void append_member(const YAML::Node& key_node, const YAML::Node& node, const std::string& path,
                   std::unordered_map<std::string, int>& lines, YamlValue& map) {
  const int line = line_in_text(key_node);
  if (!key_node.IsScalar()) throw TextFault{line, below(path, "?") + ": a key must be a name"};
  const std::string& key = key_node.Scalar();
  if (const auto [first, is_new] = lines.try_emplace(key, line); !is_new) {
    throw TextFault{line, below(path, key) + ": is there twice, first in line " +
                              std::to_string(first->second)};
  }
  map.keys.push_back(key);
  map.values.push_back(value_of(node, below(path, key)));
}

YamlValue value_of(const YAML::Node& node, const std::string& path) {
  YamlValue value;
  value.line = line_in_text(node);
  if (node.IsScalar()) {
    value.kind = YamlValue::Kind::kText;
    value.text = node.Scalar();
  } else if (node.IsSequence()) {
    value.kind = YamlValue::Kind::kList;
    for (const YAML::Node& entry : node) {
      value.values.push_back(
          value_of(entry, path + "[" + std::to_string(value.values.size()) + "]"));
    }
  } else if (node.IsMap()) {
    value.kind = YamlValue::Kind::kMap;
    std::unordered_map<std::string, int> lines;
    for (const auto& member : node) append_member(member.first, member.second, path, lines, value);
  }
  return value;
}

YamlValue parsed(const std::string& text) {
  const auto root = load_yaml(text);
  if (!root) throw TextFault{root.error().line, root.error().text()};
  try {
    return value_of(*root, {});
  } catch (const YAML::Exception& error) {
    throw TextFault{error.mark.is_null() ? 0 : error.mark.line + 1, "is not YAML: " + error.msg};
  }
}

std::string without_tags(const std::vector<std::string>& remarks) {
  std::string what = "has no tag whose place and size are known";
  for (const std::string& one : remarks) what += "; " + one;
  return what;
}

}  // namespace

std::string YamlPlace::named() const {
  return (path_.empty() ? "the text" : path_) +
         (line() > 0 ? " in line " + std::to_string(line()) : "");
}

void YamlPlace::refuse(const std::string& what) const {
  throw TextFault{line(), path_.empty() ? what : path_ + ": " + what};
}

std::string YamlPlace::found() const {
  if (value_->kind != YamlValue::Kind::kText) return "";
  constexpr std::size_t kLongestShown = 60;
  const std::string& text = value_->text;
  return " = '" + (text.size() > kLongestShown ? text.substr(0, kLongestShown) + "..." : text) +
         "'";
}

const YamlValue* YamlPlace::find(std::string_view key) const {
  if (!is_map()) throw TextFault{line(), path_ + found() + ": must be a map"};
  const auto begin = value_->keys.begin();
  const auto at = std::find(begin, value_->keys.end(), key);
  if (at == value_->keys.end()) return nullptr;
  return &value_->values[static_cast<std::size_t>(at - begin)];
}

YamlPlace YamlPlace::at(std::string_view key) const {
  const YamlValue* value = find(key);
  if (value == nullptr) throw TextFault{line(), below(path_, key) + ": is missing"};
  return {*value, below(path_, key)};
}

std::vector<std::pair<std::string, YamlPlace>> YamlPlace::members() const {
  if (!is_map()) throw TextFault{line(), path_ + found() + ": must be a map"};
  std::vector<std::pair<std::string, YamlPlace>> members;
  for (std::size_t i = 0; i < value_->keys.size(); ++i) {
    const std::string& key = value_->keys[i];
    members.emplace_back(key, YamlPlace(value_->values[i], below(path_, key)));
  }
  return members;
}

void YamlPlace::only(std::initializer_list<std::string_view> keys) const {
  if (!is_map()) throw TextFault{line(), path_ + found() + ": must be a map"};
  for (std::size_t i = 0; i < value_->keys.size(); ++i) {
    if (std::find(keys.begin(), keys.end(), value_->keys[i]) == keys.end())
      throw TextFault{value_->values[i].line, below(path_, value_->keys[i]) + ": unknown key"};
  }
}

std::vector<YamlPlace> YamlPlace::entries() const {
  if (value_->kind != YamlValue::Kind::kList)
    throw TextFault{line(), path_ + found() + ": must be a list"};
  std::vector<YamlPlace> entries;
  for (std::size_t i = 0; i < value_->values.size(); ++i)
    entries.emplace_back(value_->values[i], path_ + "[" + std::to_string(i) + "]");
  return entries;
}

const std::string& YamlPlace::text() const {
  if (value_->kind != YamlValue::Kind::kText) throw TextFault{line(), path_ + ": must be a text"};
  return value_->text;
}

double YamlPlace::number() const {
  const auto number =
      value_->kind == YamlValue::Kind::kText ? number_from<double>(value_->text) : std::nullopt;
  if (!number) throw TextFault{line(), path_ + found() + ": must be a finite number"};
  return *number;
}

int YamlPlace::integer() const {
  const auto number =
      value_->kind == YamlValue::Kind::kText ? number_from<int>(value_->text) : std::nullopt;
  if (!number) throw TextFault{line(), path_ + found() + ": must be a whole number"};
  return *number;
}

bool YamlPlace::flag() const {
  const std::string& text = value_->kind == YamlValue::Kind::kText ? value_->text : std::string();
  if (text == "true" || text == "True" || text == "yes" || text == "on") return true;
  if (text == "false" || text == "False" || text == "no" || text == "off") return false;
  throw TextFault{line(), path_ + found() + ": must be true or false"};
}

Eigen::Vector3d YamlPlace::xyz() const {
  only({"x", "y", "z"});
  return {at("x").number(), at("y").number(), at("z").number()};
}

double YamlPlace::number_or(std::string_view key, double absent) const {
  return has(key) ? at(key).number() : absent;
}

void ForeignTags::add(const KnownTag& tag, const YamlPlace& place) {
  MapTag entry;
  entry.tag = tag;
  entry.state = TagState::kSurveyed;
  if (const auto fault = unit_fault_in(tag)) place.refuse(*fault);
  if (const auto added = tags_.add(std::move(entry), place.named()); !added)
    place.refuse(added.error().what);
}

ImportedMap ForeignTags::take(std::string family, std::vector<std::string> remarks) {
  ImportedMap imported;
  imported.map.family = listed_tag_family(std::move(family));
  imported.map.tags = tags_.take();
  imported.remarks = std::move(remarks);
  return imported;
}

Expected<ImportedMap> read_foreign_yaml(const std::string& text, const MapImportOptions& options,
                                        const std::string& context,
                                        const std::function<ImportedMap(const YamlPlace&)>& read) {
  if (auto fits = check_length(text, context); !fits) return tl::unexpected<Error>(fits.error());
  try {
    const YamlValue root = parsed(text);
    ImportedMap imported = read({root, {}});
    if (imported.map.tags.empty())
      return fail(ErrorCode::kInvalid, without_tags(imported.remarks), context);
    if (auto fits = settle_family(imported, options, context); !fits)
      return tl::unexpected<Error>(fits.error());
    for (std::string& doubt : doubts_about(imported.map))
      imported.remarks.push_back(std::move(doubt));
    return imported;
  } catch (const TextFault& fault) {
    return fail(ErrorCode::kInvalid, fault.what,
                fault.line > 0 ? context + ":" + std::to_string(fault.line) : context);
  }
}

}  // namespace fiducap
