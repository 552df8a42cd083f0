#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "daemon/config/config_values.hpp"

namespace fiducap {

/// What all readers of one file share.
struct Reading {
  std::string file;                  ///< As the user wrote it; stands in messages.
  std::string folder;                ///< Base of relative paths in the file.
  std::set<std::string> overridden;  ///< Paths that came by `--set`.
  std::map<std::string, std::string>
      places{};  ///< Path → `file:line` of everything that was given.
  std::vector<ConfigFault> faults{};

  [[nodiscard]] bool is_overridden(const std::string& path) const;
  /// Where `path` was written, or the nearest section around it.
  [[nodiscard]] std::string where(const std::string& path) const;
};

/// The visitor that fills structs from one section of the file. Faults are collected, nothing is
/// thrown.
class ConfigReader final {
 public:
  /// @param path  of the section, e.g. `bodies.0`; empty: the whole file
  ConfigReader(const YAML::Node& section, std::string path, Reading& reading);

  template <typename T>
  void value(const char* key, T& out) {
    const YAML::Node node = take(key);
    if (node.IsDefined()) report(key, node, read_value(node, out));
  }
  template <typename E, std::size_t N>
  void word(const char* key, E& out, const std::array<words::Word<E>, N>& vocabulary) {
    const YAML::Node node = take(key);
    if (node.IsDefined()) report(key, node, read_word<E>(node, vocabulary, out));
  }
  template <typename T>
  void section(const char* key, T& out) {
    const YAML::Node node = take(key);
    if (node.IsDefined()) read_section(node, path_of(key), out);
  }
  template <typename T>
  void optional_section(const char* key, std::optional<T>& out) {
    const YAML::Node node = take(key);
    if (node.IsDefined() && node.IsNull()) out.reset();
    if (node.IsDefined() && !node.IsNull()) read_section(node, path_of(key), out.emplace());
  }
  template <typename T>
  void list(const char* key, std::vector<T>& out) {
    const YAML::Node node = take(key);
    if (!node.IsDefined()) return;
    if (!node.IsSequence()) return report(key, node, "must be a list");
    out.assign(node.size(), T{});
    for (std::size_t i = 0; i < out.size(); ++i) {
      read_section(node[i], path_of(key) + "." + std::to_string(i), out[i]);
    }
  }
  void seconds(const char* key, Duration& out);
  void path(const char* key, std::string& out);
  /// A camera as OpenCV opens it; only a file name is a path.
  void device(const char* key, std::string& out);

 private:
  template <typename T>
  void read_section(const YAML::Node& node, const std::string& path, T& out) {
    ConfigReader reader(node, path, reading_);
    describe(reader, out);
    reader.finish();
  }
  template <typename T>
  friend void read_whole(const YAML::Node& node, Reading& reading, T& out);

  [[nodiscard]] std::string path_of(const std::string& key) const {
    return path_.empty() ? key : path_ + "." + key;
  }
  [[nodiscard]] std::string resolved(const std::string& path, const std::string& file) const;
  [[nodiscard]] YAML::Node take(const char* key);
  void report(const std::string& key, const YAML::Node& node, const Broken& broken);
  /// Keys that nobody took, and keys given twice.
  void finish();

  YAML::Node section_;
  std::string path_;
  Reading& reading_;
  std::vector<std::string> known_;
};

template <typename T>
void read_whole(const YAML::Node& node, Reading& reading, T& out) {
  ConfigReader reader(node, "", reading);
  describe(reader, out);
  reader.finish();
}

}  // namespace fiducap
