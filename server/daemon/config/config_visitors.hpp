#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "base/time.hpp"
#include "base/yaml.hpp"
#include "base/yaml_section.hpp"

namespace fiducap {

/// The visitor that writes structs as YAML.
class ConfigPrinter final {
 public:
  template <typename T>
  void value(const char* key, const T& x) {
    line(key, text_of(x));
  }
  template <typename E, std::size_t N>
  void word(const char* key, const E& x, const std::array<words::Word<E>, N>& vocabulary) {
    line(key, text_of_word<E>(vocabulary, x));
  }
  void seconds(const char* key, const Duration& x) { line(key, text_of(to_seconds(x))); }
  void path(const char* key, const std::string& x) { line(key, text_of(x)); }
  /// Never printed: prints and recordings may be public.
  void secret(const char* key, const std::string& x) {
    line(key, x.empty() ? "\"\"" : "\"\"  # set, not shown");
  }
  void device(const char* key, const std::string& x) { line(key, text_of(x)); }
  void former(const char* /*key*/, const char* /*instead*/) {}

  template <typename T>
  void section(const char* key, T& x) {
    line(key, "");
    indent_ += kStep;
    describe(*this, x);
    indent_ -= kStep;
  }
  template <typename T>
  void optional_section(const char* key, std::optional<T>& x) {
    if (x) return section(key, *x);
    line(key, "null");
  }
  template <typename T>
  void list(const char* key, std::vector<T>& items) {
    if (items.empty()) return line(key, "[]");
    line(key, "");
    indent_ += 2 * kStep;
    for (auto& item : items) {
      at_dash_ = true;
      describe(*this, item);
    }
    indent_ -= 2 * kStep;
  }

  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  static constexpr std::size_t kStep = 2;

  void line(const std::string& key, const std::string& value) {
    text_ += at_dash_ ? std::string(indent_ - kStep, ' ') + "- " : std::string(indent_, ' ');
    text_ += key + (value.empty() ? ":" : ": " + value) + "\n";
    at_dash_ = false;
  }

  std::string text_;
  std::size_t indent_{0};
  bool at_dash_{false};
};

/// The visitor that fills structs from one section of the file. Faults are collected, nothing is
/// thrown.
class ConfigReader final {
 public:
  static constexpr bool kFills = true;

  explicit ConfigReader(YamlSection section) : section_(std::move(section)) {}

  template <typename T>
  void value(const char* key, T& out) {
    section_.read(key, out);
  }
  template <typename E, std::size_t N>
  void word(const char* key, E& out, const std::array<words::Word<E>, N>& vocabulary) {
    const YAML::Node node = section_.take(key);
    if (!node.IsDefined()) return;
    const auto broken = read_word<E>(node, vocabulary, out);
    section_.report(key, node, broken);
    if (broken && std::string_view(key) == "type") is_type_known_ = false;
  }
  template <typename T>
  void section(const char* key, T& out) {
    const YAML::Node node = section_.take(key);
    if (node.IsDefined()) read_all(section_.below(node, key), out);
  }
  template <typename T>
  void optional_section(const char* key, std::optional<T>& out) {
    const YAML::Node node = section_.take(key);
    if (node.IsDefined() && node.IsNull()) out.reset();
    if (node.IsDefined() && !node.IsNull()) read_all(section_.below(node, key), out.emplace());
  }
  template <typename T>
  void list(const char* key, std::vector<T>& out) {
    const YAML::Node node = section_.take(key);
    if (!node.IsDefined()) return;
    if (!node.IsSequence()) return section_.report(key, node, "must be a list");
    out.assign(node.size(), T{});
    for (std::size_t i = 0; i < out.size(); ++i)
      read_all(section_.below(node[i], std::string(key) + "." + std::to_string(i)), out[i]);
  }
  void seconds(const char* key, Duration& out) {
    double value = std::numeric_limits<double>::quiet_NaN();
    section_.read(key, value);
    if (!std::isnan(value)) out = from_seconds(value);
  }
  void secret(const char* key, std::string& out) { value(key, out); }
  /// A key of earlier versions: old files and recorded sessions may have it.
  void former(const char* key, const char* instead) {
    if (section_.take(key).IsDefined())
      log::warning("daemon", section_.path_of(key) + " is not used any more: " + instead);
  }
  void path(const char* key, std::string& out) {
    const YAML::Node node = section_.take(key);
    if (!node.IsDefined()) return;
    section_.report(key, node, read_value(node, out));
    if (!out.empty()) out = resolved(key, out);
  }
  /// A camera as OpenCV opens it; only a file name is a path.
  void device(const char* key, std::string& out) {
    const YAML::Node node = section_.take(key);
    if (!node.IsDefined()) return;
    section_.report(key, node, read_value(node, out));
    if (!out.empty() && is_file_name(out)) out = resolved(key, out);
  }

  /// Fills `out` from all of a section. Keys that `out` does not have are faults.
  template <typename T>
  static void read_all(YamlSection section, T& out) {
    ConfigReader reader(std::move(section));
    describe(reader, out);
    // The type decides which keys there are.
    if (reader.is_type_known_) reader.section_.refuse_unknown_keys();
  }

 private:
  [[nodiscard]] std::string resolved(const char* key, const std::string& file) const {
    const YamlReading& reading = section_.reading();
    const bool by_file = !reading.is_overridden(section_.path_of(key));
    const std::filesystem::path base = by_file ? reading.folder : "";
    return std::filesystem::absolute(base / file).lexically_normal().string();
  }
  [[nodiscard]] static bool is_file_name(const std::string& device) {
    const bool number = std::ranges::all_of(device, [](char c) { return c >= '0' && c <= '9'; });
    return !number && device.find('!') == std::string::npos && !device.starts_with("libcamera:") &&
           device.find("://") == std::string::npos;
  }

  YamlSection section_;
  bool is_type_known_{true};
};

}  // namespace fiducap
