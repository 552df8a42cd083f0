#include "mapping/formats/yaml_place.hpp"

#include <algorithm>
#include <unordered_map>

#include "base/yaml.hpp"
#include "detection/tag_family.hpp"

namespace fiducap {

namespace {

/// First fault of a text, thrown and caught in this file only.
struct TextFault {
  int line;
  std::string what;
};

int line_in_text(const YAML::Mark& mark) { return mark.is_null() ? 0 : mark.line + 1; }

std::string below(const std::string& path, std::string_view key) {
  return path.empty() ? std::string(key) : path + "." + std::string(key);
}

std::string below(const std::string& path, std::size_t index) {
  return path + "[" + std::to_string(index) + "]";
}

/// All keys are names, and no map has one twice.
void check_keys(const YAML::Node& node, const std::string& path) {
  if (node.IsSequence()) {
    std::size_t index = 0;
    for (const YAML::Node& entry : node) check_keys(entry, below(path, index++));
  }
  if (!node.IsMap()) return;
  std::unordered_map<std::string, int> lines;
  for (const auto& member : node) {
    const int line = line_in_text(member.first.Mark());
    if (!member.first.IsScalar())
      throw TextFault{line, below(path, "?") + ": a key must be a name"};
    const std::string& key = member.first.Scalar();
    if (const auto [first, is_new] = lines.try_emplace(key, line); !is_new)
      throw TextFault{line, below(path, key) + ": is there twice, first in line " +
                                std::to_string(first->second)};
    check_keys(member.second, below(path, key));
  }
}

YAML::Node parsed(const std::string& text) {
  const auto root = load_yaml(text);
  if (!root) throw TextFault{root.error().line, root.error().text()};
  check_keys(*root, {});
  return *root;
}

}  // namespace

int YamlPlace::line() const { return line_in_text(node_.Mark()); }

std::string YamlPlace::named() const {
  return (path_.empty() ? "the text" : path_) +
         (line() > 0 ? " in line " + std::to_string(line()) : "");
}

void YamlPlace::refuse(const std::string& what) const {
  throw TextFault{line(), path_.empty() ? what : path_ + ": " + what};
}

void YamlPlace::refuse_value(const std::string& rule) const {
  if (!node_.IsScalar() || path_.empty()) refuse(rule);
  constexpr std::size_t kLongestShown = 60;
  const std::string& text = node_.Scalar();
  throw TextFault{line(),
                  path_ + " = '" +
                      (text.size() > kLongestShown ? text.substr(0, kLongestShown) + "..." : text) +
                      "': " + rule};
}

bool YamlPlace::has(const std::string& key) const {
  if (!is_map()) refuse_value("must be a map");
  return node_[key].IsDefined();
}

YamlPlace YamlPlace::at(const std::string& key) const {
  if (!has(key)) throw TextFault{line(), below(path_, key) + ": is missing"};
  return {node_[key], below(path_, key)};
}

std::vector<std::pair<std::string, YamlPlace>> YamlPlace::members() const {
  if (!is_map()) refuse_value("must be a map");
  std::vector<std::pair<std::string, YamlPlace>> members;
  for (const auto& member : node_) {
    const std::string& key = member.first.Scalar();
    members.emplace_back(key, YamlPlace(member.second, below(path_, key)));
  }
  return members;
}

void YamlPlace::only(Keys keys) const {
  for (const auto& [key, place] : members())
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) place.refuse("unknown key");
}

void YamlPlace::remark_others(Keys keys, std::vector<std::string>& remarks) const {
  std::string others;
  for (const auto& [key, place] : members()) {
    if (std::find(keys.begin(), keys.end(), key) == keys.end())
      others += (others.empty() ? "" : ", ") + key;
  }
  if (!others.empty()) remarks.push_back("not read: " + others);
}

std::vector<YamlPlace> YamlPlace::entries() const {
  if (!node_.IsSequence()) refuse_value("must be a list");
  std::vector<YamlPlace> entries;
  for (const YAML::Node& entry : node_) entries.emplace_back(entry, below(path_, entries.size()));
  return entries;
}

const std::string& YamlPlace::text() const {
  if (!node_.IsScalar()) refuse("must be a text");
  return node_.Scalar();
}

template <typename T>
T YamlPlace::number_of(const char* rule) const {
  const auto number = node_.IsScalar() ? number_from<T>(node_.Scalar()) : std::nullopt;
  if (!number) refuse_value(rule);
  return *number;
}

double YamlPlace::number() const { return number_of<double>("must be a finite number"); }
int YamlPlace::integer() const { return number_of<int>("must be a whole number"); }
std::int64_t YamlPlace::integer64() const {
  return number_of<std::int64_t>("must be a whole number");
}

void YamlPlace::numbers(std::span<double> out) const {
  if (!node_.IsSequence() || node_.size() != out.size())
    refuse("must be a list of " + std::to_string(out.size()) + " numbers");
  const auto all = entries();
  std::transform(all.begin(), all.end(), out.begin(),
                 [](const YamlPlace& one) { return one.number(); });
}

bool YamlPlace::flag() const {
  const std::string text = node_.IsScalar() ? node_.Scalar() : std::string();
  if (text == "true" || text == "True" || text == "yes" || text == "on") return true;
  if (text == "false" || text == "False" || text == "no" || text == "off") return false;
  refuse_value("must be true or false");
}

Eigen::Vector3d YamlPlace::xyz() const {
  only({"x", "y", "z"});
  return {at("x").number(), at("y").number(), at("z").number()};
}

double YamlPlace::number_or(const std::string& key, double absent) const {
  return has(key) ? at(key).number() : absent;
}

void ForeignTags::add(const KnownTag& tag, const YamlPlace& place) {
  MapTag entry;
  entry.tag = tag;
  entry.state = TagState::kSurveyed;
  if (const auto fault = unit_fault_of_edge(tag.edge_m)) place.refuse(*fault);
  if (const auto fault = unit_fault_of_place(tag.X_WT.p)) place.refuse(*fault);
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

Expected<void> read_yaml(const std::string& text, const std::string& context,
                         const std::function<void(const YamlPlace&)>& read) {
  if (auto fits = check_length(text, context); !fits) return fits;
  try {
    read({parsed(text), {}});
    return {};
  } catch (const TextFault& fault) {
    return fail(ErrorCode::kInvalid, fault.what,
                fault.line > 0 ? context + ":" + std::to_string(fault.line) : context);
  } catch (const YAML::Exception& error) {
    return fail(ErrorCode::kInvalid, "is not YAML: " + error.msg, context);
  }
}

Expected<ImportedMap> read_foreign_yaml(const std::string& text, const MapImportOptions& options,
                                        const std::string& context,
                                        const std::function<ImportedMap(const YamlPlace&)>& read) {
  ImportedMap imported;
  const auto done = read_yaml(text, context, [&](const YamlPlace& top) { imported = read(top); });
  if (!done) return tl::unexpected<Error>(done.error());
  if (!imported.map.tags.empty()) return checked_import(std::move(imported), options, context);
  std::string what = "has no tag whose place and size are known";
  for (const std::string& one : imported.remarks) what += "; " + one;
  return fail(ErrorCode::kInvalid, what, context);
}

}  // namespace fiducap
