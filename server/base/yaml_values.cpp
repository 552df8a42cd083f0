#include "base/yaml_values.hpp"

#include <charconv>
#include <cmath>

namespace fiducap {

namespace {

/// A quoted scalar is text on purpose; yaml-cpp marks it with the tag "!".
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

template <typename T>
std::string plain_text(T value) {
  std::array<char, 40> buffer{};
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), result.ptr};
}

/// `[a, b]`, with these brackets.
template <typename Range, typename ToText>
std::string joined(char open, const Range& range, char close, ToText to_text) {
  std::string text(1, open);
  for (const auto& item : range) {
    if (text.size() > 1) text += ", ";
    text += to_text(item);
  }
  text += close;
  return text;
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

template <typename Key, typename Value>
std::string text_of_map(const std::map<Key, Value>& value) {
  return joined('{', value, '}',
                [](const auto& v) { return text_of(v.first) + ": " + text_of(v.second); });
}

}  // namespace

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
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (read_value(node[i], out[i])) return rule;
  }
  return std::nullopt;
}

Broken read_value(const YAML::Node& node, Eigen::Vector3d& out) {
  return read_numbers(node, {out.data(), 3});
}

Broken read_value(const YAML::Node& node, Pose& out) {
  constexpr double kUnit = 1e-3;    // what hand-typed digits may leave out
  constexpr double kExact = 1e-12;  // below it the text is ours: kept to the last bit
  const char* rule = "must be {p: [x, y, z], q_wxyz: [w, x, y, z]} with a unit quaternion";
  if (!node.IsMap()) return rule;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  std::array<double, 4> q{1, 0, 0, 0};
  for (const auto& entry : node) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
    if (key == "p" && !read_value(entry.second, p)) continue;
    if (key == "q_wxyz" && !read_value(entry.second, q)) continue;
    return rule;
  }
  Eigen::Quaterniond q_AB(q[0], q[1], q[2], q[3]);
  if (std::abs(q_AB.norm() - 1) > kUnit) return rule;
  if (std::abs(q_AB.norm() - 1) > kExact) q_AB.normalize();
  out = {q_AB, p};
  return std::nullopt;
}

Broken read_value(const YAML::Node& node, std::vector<int>& out) {
  const char* rule = "must be a list of whole numbers";
  if (!node.IsSequence()) return rule;
  std::vector<int> values(node.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (read_value(node[i], values[i])) return rule;
  }
  out = std::move(values);
  return std::nullopt;
}

Broken read_value(const YAML::Node& node, std::vector<std::string>& out) {
  const char* rule = "must be a list of texts";
  if (!node.IsSequence()) return rule;
  std::vector<std::string> values(node.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (read_value(node[i], values[i])) return rule;
  }
  out = std::move(values);
  return std::nullopt;
}

Broken read_value(const YAML::Node& node, std::map<int, double>& out) {
  return read_map(node, "must be a section of `id: number`", out);
}

Broken read_value(const YAML::Node& node, std::map<std::string, std::string>& out) {
  return read_map(node, "must be a section of `name: other name`", out);
}

std::string text_of(bool value) { return value ? "true" : "false"; }
std::string text_of(int value) { return plain_text(value); }
std::string text_of(std::uint16_t value) { return plain_text(value); }
std::string text_of(std::uint64_t value) { return plain_text(value); }
std::string text_of(double value) { return plain_text(value); }

std::string text_of(const std::string& value) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << value;
  return out.c_str();
}

std::string text_of_numbers(std::span<const double> values) {
  return joined('[', values, ']', [](double v) { return text_of(v); });
}

std::string text_of(const Eigen::Vector3d& value) { return text_of_numbers({value.data(), 3}); }

std::string text_of(const Pose& value) {
  const std::array<double, 4> q{value.q.w(), value.q.x(), value.q.y(), value.q.z()};
  return "{p: " + text_of(value.p) + ", q_wxyz: " + text_of(q) + "}";
}

std::string text_of(const std::vector<int>& value) {
  return joined('[', value, ']', [](int v) { return text_of(v); });
}

std::string text_of(const std::vector<std::string>& value) {
  return joined('[', value, ']', [](const std::string& v) { return text_of(v); });
}

std::string text_of(const std::map<int, double>& value) { return text_of_map(value); }
std::string text_of(const std::map<std::string, std::string>& value) { return text_of_map(value); }

}  // namespace fiducap
