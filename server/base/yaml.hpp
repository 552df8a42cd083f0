#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include <yaml-cpp/yaml.h>
#include <Eigen/Core>

#include "base/config_check.hpp"
#include "base/pose.hpp"
#include "base/text.hpp"

/// Text → YAML nodes, and one value ↔ YAML; sections are in yaml_section.hpp.
namespace fiducap {

/// Why a text is refused as YAML.
struct YamlFault {
  int line{};         ///< From 1; 0: not known.
  std::string path;   ///< e.g. `bodies.0`; empty: the whole text.
  std::string value;  ///< The text there; may be empty.
  std::string rule;   ///< e.g. `is deeper than 100 levels`

  [[nodiscard]] std::string text() const {
    return path + (value.empty() ? "" : " = " + value) + (path.empty() ? "" : ": ") + rule;
  }
};

/// Parses an untrusted text: one document, at most 100 levels, 10000 values repeated by aliases.
[[nodiscard]] tl::expected<YAML::Node, YamlFault> load_yaml(const std::string& text);

/// nullopt: the value was read; else the rule that the text breaks.
using Broken = std::optional<std::string>;

[[nodiscard]] Broken read_value(const YAML::Node& node, bool& out);
[[nodiscard]] Broken read_value(const YAML::Node& node, int& out);
[[nodiscard]] Broken read_value(const YAML::Node& node, std::uint16_t& out);
[[nodiscard]] Broken read_value(const YAML::Node& node, std::uint64_t& out);
[[nodiscard]] Broken read_value(const YAML::Node& node, double& out);
[[nodiscard]] Broken read_value(const YAML::Node& node, std::string& out);
/// {p: [x, y, z], q_wxyz: [w, x, y, z]}
[[nodiscard]] Broken read_value(const YAML::Node& node, Pose& out);
[[nodiscard]] Broken read_value(const YAML::Node& node, Eigen::Vector3d& out);
[[nodiscard]] Broken read_value(const YAML::Node& node, std::vector<int>& out);
[[nodiscard]] Broken read_value(const YAML::Node& node, std::vector<std::string>& out);
[[nodiscard]] Broken read_value(const YAML::Node& node, std::map<int, double>& out);
[[nodiscard]] Broken read_value(const YAML::Node& node, std::map<std::string, std::string>& out);
[[nodiscard]] Broken read_numbers(const YAML::Node& node, std::span<double> out);

[[nodiscard]] std::string text_of(bool value);
[[nodiscard]] std::string text_of(std::integral auto value) { return std::to_string(value); }
[[nodiscard]] std::string text_of(double value);
[[nodiscard]] std::string text_of(const std::string& value);
[[nodiscard]] std::string text_of(const Pose& value);
[[nodiscard]] std::string text_of(const Eigen::Vector3d& value);
[[nodiscard]] std::string text_of_numbers(std::span<const double> values);
template <typename T>
[[nodiscard]] std::string text_of(const std::vector<T>& values) {
  return '[' + comma_list(values, [](const T& value) { return text_of(value); }) + ']';
}
template <typename Key, typename T>
[[nodiscard]] std::string text_of(const std::map<Key, T>& values) {
  const auto entry = [](const auto& v) { return text_of(v.first) + ": " + text_of(v.second); };
  return '{' + comma_list(values, entry) + '}';
}

/// At most N numbers; the others are 0.
template <std::size_t N>
[[nodiscard]] Broken read_value(const YAML::Node& node, std::array<double, N>& out) {
  const std::size_t count = node.IsSequence() ? node.size() : N + 1;
  if (count > N) return "must be a list of at most " + std::to_string(N) + " numbers";
  out = {};
  return read_numbers(node, std::span(out).first(count));
}
template <std::size_t N>
[[nodiscard]] std::string text_of(const std::array<double, N>& value) {
  return text_of_numbers(value);
}

/// `null`: not given.
template <typename T>
[[nodiscard]] Broken read_value(const YAML::Node& node, std::optional<T>& out) {
  if (node.IsNull()) {
    out.reset();
    return std::nullopt;
  }
  return read_value(node, out.emplace());
}
template <typename T>
[[nodiscard]] std::string text_of(const std::optional<T>& value) {
  return value ? text_of(*value) : "null";
}

template <typename E>
[[nodiscard]] Broken read_word(const YAML::Node& node, std::span<const words::Word<E>> vocabulary,
                               E& out) {
  std::vector<std::string> all;
  for (const auto& word : vocabulary) {
    if (node.IsScalar() && node.Scalar() == word.text) {
      out = word.value;
      return std::nullopt;
    }
    all.emplace_back(word.text);
  }
  return must_be_one_of(all, node.IsScalar() ? node.Scalar() : "");
}
template <typename E>
[[nodiscard]] std::string text_of_word(std::span<const words::Word<E>> vocabulary, E value) {
  for (const auto& word : vocabulary)
    if (word.value == value) return std::string(word.text);
  return "null";
}

}  // namespace fiducap
