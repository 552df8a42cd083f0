#pragma once

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/pose.hpp"
#include "base/yaml.hpp"

namespace fiducap {

/// Shared by all sections of one file: where values were written, and the faults so far.
struct YamlReading {
  std::string file;                             ///< As the user wrote it; used in messages.
  std::string folder{};                         ///< Base of relative paths in the file.
  std::set<std::string> overridden{};           ///< Paths that `--set` has replaced.
  std::map<std::string, std::string> places{};  ///< Path → `file:line` of all values.
  std::vector<ConfigFault> faults{};

  [[nodiscard]] bool is_overridden(const std::string& path) const {
    return std::ranges::any_of(overridden, [&](const std::string& set) {
      return path == set || path.rfind(set + ".", 0) == 0;
    });
  }
  /// Place of `path`, or of the nearest section around it.
  [[nodiscard]] std::string where(const std::string& path) const;
};

/// One map of a YAML file. Does not throw: collects all faults with path, value and rule.
class YamlSection final {
 public:
  /// A calibration file of at most 16 MiB. Accepts JSON and OpenCV's first line `%YAML:1.0`.
  [[nodiscard]] static Expected<YamlSection> load(const std::filesystem::path& path);
  /// @param path  of the section, e.g. `bodies.0`; empty: the whole file
  YamlSection(const YAML::Node& node, std::string path, std::shared_ptr<YamlReading> reading);

  [[nodiscard]] bool has(const std::string& key) const {
    const YAML::Node found = find(key);
    return found.IsDefined() && !found.IsNull();
  }
  [[nodiscard]] bool is_map(const std::string& key) const { return has(key) && find(key).IsMap(); }
  /// The node at `key`, or an undefined one. The key is known from now on.
  [[nodiscard]] YAML::Node take(const std::string& key) const;
  [[nodiscard]] std::string path_of(const std::string& key) const {
    return path_.empty() ? key : path_ + "." + key;
  }
  /// `node`, found at or below `key`, as a section; a fault when it is not a map.
  [[nodiscard]] YamlSection below(const YAML::Node& node, const std::string& key) const {
    return {node, path_of(key), reading_};
  }
  [[nodiscard]] YamlReading& reading() const { return *reading_; }

  /// Absent: `out` stays. Invalid: a fault, and `out` stays.
  template <typename T>
  void read(const std::string& key, T& out) const {
    const YAML::Node node = take(key);
    if (node.IsDefined()) report(key, node, read_value(node, out));
  }
  /// The map below `key`; a section without keys when there is none.
  [[nodiscard]] YamlSection section(const std::string& key) const {
    const YAML::Node found = take(key);
    const bool there = found.IsDefined() && !found.IsNull();
    return below(there ? found : YAML::Node(YAML::NodeType::Map), key);
  }
  /// The maps of the list below `key`; empty when there is none.
  [[nodiscard]] std::vector<YamlSection> sections(const std::string& key) const;

  /// Absent: nullopt. Not a finite number: a fault and nullopt.
  [[nodiscard]] std::optional<double> number(const std::string& key) const;
  [[nodiscard]] std::optional<int> integer(const std::string& key) const;
  [[nodiscard]] std::optional<std::string> text(const std::string& key) const;
  /// A list, nested lists row by row, or OpenCV's {rows, cols, data}. Absent: empty.
  [[nodiscard]] std::vector<double> numbers(const std::string& key) const;
  /// A 4 × 4 matrix as a pose; a fault when it is not a rigid one.
  [[nodiscard]] std::optional<Pose> pose(const std::string& key) const;
  /// The same getters, where absence is a fault.
  [[nodiscard]] double required_number(const std::string& key) const {
    if (!has(key)) add_fault(key, "is missing");
    return number(key).value_or(0);
  }
  [[nodiscard]] int required_integer(const std::string& key) const {
    if (!has(key)) add_fault(key, "is missing");
    return integer(key).value_or(0);
  }
  [[nodiscard]] std::vector<double> required_numbers(const std::string& key,
                                                     std::size_t count) const;
  [[nodiscard]] Pose required_pose(const std::string& key) const {
    if (!has(key)) add_fault(key, "is missing");
    return pose(key).value_or(Pose{});
  }

  void report(const std::string& key, const YAML::Node& node, const Broken& broken) const;
  void add_fault(const std::string& key, const std::string& rule) const {
    const std::string path = path_of(key);
    reading_->faults.push_back({{path, "", rule}, reading_->where(path)});
  }
  /// Keys that were not read, and keys given twice, are faults.
  void refuse_unknown_keys() const;
  /// Error with all faults of the file so far, this section's parents and children included.
  [[nodiscard]] Expected<void> check() const;

 private:
  [[nodiscard]] YAML::Node find(const std::string& key) const {
    if (!node_.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
    const YAML::Node& looked_at = node_;  // the const operator does not add the key
    const YAML::Node found = looked_at[key];
    return found.IsDefined() ? found : YAML::Node(YAML::NodeType::Undefined);
  }
  template <typename T>
  [[nodiscard]] std::optional<T> get(const std::string& key) const;
  void append_numbers(const std::string& key, const YAML::Node& node, int depth,
                      std::vector<double>& out) const;

  YAML::Node node_;
  std::string path_;
  std::shared_ptr<YamlReading> reading_;
  mutable std::vector<std::string> known_;
};

}  // namespace fiducap
