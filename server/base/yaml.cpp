#include "base/yaml.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <utility>

#include <yaml-cpp/eventhandler.h>

namespace fiducap {
namespace {

// Cameras of many bodies with one calibration repeat some hundred values, in up to ten levels.
constexpr std::size_t kMostRepeated = 10'000;
constexpr std::size_t kDeepest = 100;

/// Counts the values that aliases repeat, from parser events, before nodes are built.
class AliasCheck final : public YAML::EventHandler {
 public:
  [[nodiscard]] const std::optional<YamlFault>& fault() const { return fault_; }

  /// Of the last document.
  [[nodiscard]] bool is_empty() const { return is_empty_; }

  void OnDocumentStart(const YAML::Mark&) override { is_empty_ = true; }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t anchor) override { add_value("", anchor); }
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t anchor,
                const std::string& value) override {
    is_empty_ = false;
    add_value(value, anchor);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(mark, false, anchor);
  }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(mark, true, anchor);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapEnd() override { close(); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    is_empty_ = false;
    begin_entry("?");
    const auto found = anchored_.find(anchor);
    if (found == anchored_.end())
      return set_fault(mark, "an alias", "repeats the list or section that contains it");
    repeated_ += found->second.values;
    if (repeated_ > kMostRepeated)
      return set_fault(mark, "an alias", "aliases repeat more than 10000 values");
    if (open_.size() + found->second.levels > kDeepest)
      return set_fault(mark, "an alias", "is deeper than 100 levels");
    add(found->second);
  }

 private:
  struct Size {
    std::size_t values{1};
    std::size_t levels{1};
  };
  /// A list or map whose end was not read yet.
  struct Open {
    bool is_map{};
    YAML::anchor_t anchor{};
    std::size_t entries{0};  ///< Keys and values of a map.
    std::string key{};
    Size size{};
  };

  void open(const YAML::Mark& mark, bool is_map, YAML::anchor_t anchor) {
    is_empty_ = false;
    begin_entry("?");
    open_.push_back({is_map, anchor});
    if (open_.size() > kDeepest) set_fault(mark, "", "is deeper than 100 levels");
  }

  void close() {
    const Open done = std::move(open_.back());
    open_.pop_back();
    if (done.anchor != YAML::NullAnchor) anchored_[done.anchor] = done.size;
    add(done.size);
  }

  void add_value(const std::string& value, YAML::anchor_t anchor) {
    begin_entry(value);
    if (anchor != YAML::NullAnchor) anchored_[anchor] = {};
    add({});
  }

  /// Entries of a map alternate between key and value.
  void begin_entry(const std::string& value) {
    if (open_.empty()) return;
    Open& around = open_.back();
    if (around.is_map && around.entries % 2 == 0) around.key = value;
    ++around.entries;
  }

  void add(const Size& size) {
    if (open_.empty()) return;
    Size& around = open_.back().size;
    around.values += size.values;
    around.levels = std::max(around.levels, size.levels + 1);
  }

  void set_fault(const YAML::Mark& mark, const std::string& value, const std::string& rule) {
    if (!fault_) fault_ = YamlFault{mark.line + 1, path(), value, rule};
  }

  [[nodiscard]] std::string path() const {
    std::string path;
    for (const Open& level : open_) {
      const std::string step = level.is_map         ? level.key
                               : level.entries == 0 ? ""
                                                    : std::to_string(level.entries - 1);
      if (!step.empty()) path += (path.empty() ? "" : ".") + step;
    }
    return path;
  }

  std::vector<Open> open_;
  std::map<YAML::anchor_t, Size> anchored_;
  std::size_t repeated_{0};
  bool is_empty_{true};
  std::optional<YamlFault> fault_;
};

/// Not quoted: yaml-cpp marks quoted scalars with the tag "!".
bool is_plain(const YAML::Node& node) { return node.IsScalar() && node.Tag() != "!"; }

template <typename T>
Broken read_plain(const YAML::Node& node, T& out, const char* rule) {
  if (!is_plain(node)) return rule;
  std::string_view text = node.Scalar();
  if (text.starts_with('+')) text.remove_prefix(1);
  T value{};
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failure == std::errc::result_out_of_range) return std::string(rule) + " that fits";
  if (failure != std::errc{} || end != text.data() + text.size()) return rule;
  out = value;
  return std::nullopt;
}

template <typename Value>
Broken read_list(const YAML::Node& node, const char* rule, std::vector<Value>& out) {
  if (!node.IsSequence()) return rule;
  std::vector<Value> values(node.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    if (read_value(node[i], values[i])) return rule;
  out = std::move(values);
  return std::nullopt;
}

template <typename Key, typename Value>
Broken read_map(const YAML::Node& node, const char* rule, std::map<Key, Value>& out) {
  if (!node.IsMap()) return rule;
  std::map<Key, Value> values;
  for (const auto& entry : node) {
    Key key{};
    Value value{};
    if (read_value(entry.first, key) || read_value(entry.second, value)) return rule;
    values[key] = value;
  }
  out = std::move(values);
  return std::nullopt;
}

}  // namespace

tl::expected<YAML::Node, YamlFault> load_yaml(const std::string& text) {
  try {
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    AliasCheck check;
    (void)parser.HandleNextDocument(check);
    if (check.fault()) return tl::unexpected(*check.fault());
    // Not LoadAll: yaml-cpp never gets past a comma where a document begins.
    // A last line `---` begins a second, empty document.
    AliasCheck after;
    if (parser.HandleNextDocument(after) && (!after.is_empty() || parser.HandleNextDocument(after)))
      return tl::unexpected(YamlFault{
          0, "", "",
          "holds several documents, or text after the first one's end: remove the line ---, or "
          "the comma at its start"});
    return YAML::Load(text);
  } catch (const YAML::Exception& broken) {
    const int line = broken.mark.is_null() ? 0 : broken.mark.line + 1;
    return tl::unexpected(YamlFault{line, "", "", "is not YAML: " + broken.msg});
  }
}

Broken read_value(const YAML::Node& node, bool& out) {
  if (!is_plain(node) || (node.Scalar() != "true" && node.Scalar() != "false"))
    return "must be true or false";
  out = node.Scalar() == "true";
  return std::nullopt;
}

Broken read_value(const YAML::Node& node, int& out) {
  return read_plain(node, out, "must be a whole number");
}

Broken read_value(const YAML::Node& node, std::uint16_t& out) {
  return read_plain(node, out, "must be a whole number in [0, 65535]");
}

Broken read_value(const YAML::Node& node, std::uint64_t& out) {
  return read_plain(node, out, "must be a whole number >= 0");
}

Broken read_value(const YAML::Node& node, double& out) {
  double value{};
  if (auto broken = read_plain(node, value, "must be a number")) return broken;
  if (!std::isfinite(value)) return "must be a finite number";
  out = value;
  return std::nullopt;
}

Broken read_value(const YAML::Node& node, std::string& out) {
  if (!node.IsScalar()) return "must be a text";
  out = node.Scalar();
  return std::nullopt;
}

Broken read_numbers(const YAML::Node& node, std::span<double> out) {
  const std::string rule = "must be a list of " + std::to_string(out.size()) + " numbers";
  if (!node.IsSequence() || node.size() != out.size()) return rule;
  for (std::size_t i = 0; i < out.size(); ++i)
    if (read_value(node[i], out[i])) return rule;
  return std::nullopt;
}

Broken read_value(const YAML::Node& node, Eigen::Vector3d& out) {
  return read_numbers(node, {out.data(), 3});
}

Broken read_value(const YAML::Node& node, Pose& out) {
  constexpr double kUnit = 1e-3;    // tolerance for hand-typed digits
  constexpr double kExact = 1e-12;  // written by us: kept to the last bit
  const char* rule = "must be {p: [x, y, z], q_wxyz: [w, x, y, z]} with a unit quaternion";
  if (!node.IsMap()) return rule;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  std::array<double, 4> q{1, 0, 0, 0};
  for (const auto& entry : node) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
    if (key == "p" && !read_value(entry.second, p)) continue;
    if (key == "q_wxyz" && !read_numbers(entry.second, q)) continue;
    return rule;
  }
  Eigen::Quaterniond q_AB(q[0], q[1], q[2], q[3]);
  if (std::abs(q_AB.norm() - 1) > kUnit) return rule;
  if (std::abs(q_AB.norm() - 1) > kExact) q_AB.normalize();
  out = {q_AB, p};
  return std::nullopt;
}

Broken read_value(const YAML::Node& node, std::vector<int>& out) {
  return read_list(node, "must be a list of whole numbers", out);
}

Broken read_value(const YAML::Node& node, std::vector<std::string>& out) {
  return read_list(node, "must be a list of texts", out);
}

Broken read_value(const YAML::Node& node, std::map<int, double>& out) {
  return read_map(node, "must be a section of `id: number`", out);
}

Broken read_value(const YAML::Node& node, std::map<std::string, std::string>& out) {
  return read_map(node, "must be a section of `name: other name`", out);
}

std::string text_of(bool value) { return value ? "true" : "false"; }
std::string text_of(double value) { return shortest(value); }

std::string text_of(const std::string& value) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << value;
  return out.c_str();
}

std::string text_of_numbers(std::span<const double> values) {
  return '[' + comma_list(values, shortest) + ']';
}

std::string text_of(const Eigen::Vector3d& value) { return text_of_numbers({value.data(), 3}); }

std::string text_of(const Pose& value) {
  const std::array<double, 4> q{value.q.w(), value.q.x(), value.q.y(), value.q.z()};
  return "{p: " + text_of(value.p) + ", q_wxyz: " + text_of(q) + "}";
}

}  // namespace fiducap
