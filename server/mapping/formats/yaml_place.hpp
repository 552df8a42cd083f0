#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "base/pose.hpp"
#include "mapping/formats/map_exchange.hpp"
#include "mapping/formats/map_format.hpp"

namespace fiducap {

/// A value and its path from the top, e.g. `tags.tag7.pose`. Getters throw the fault of the text
/// when the value is of another kind; `read_yaml` makes an Error of it.
class YamlPlace final {
 public:
  YamlPlace(YAML::Node node, std::string path) : node_(std::move(node)), path_(std::move(path)) {}
  YamlPlace(const YamlPlace&) = default;
  YamlPlace& operator=(const YamlPlace&) = delete;  // would change the tree

  [[nodiscard]] const std::string& path() const { return path_; }
  /// From 1; 0: not known.
  [[nodiscard]] int line() const;
  /// Path and line, to refer to this place in the message about another.
  [[nodiscard]] std::string named() const;
  [[nodiscard]] bool is_empty() const {
    return !is_map() && !node_.IsScalar() && !node_.IsSequence();
  }
  [[nodiscard]] bool is_map() const { return node_.IsMap(); }

  /// Of a map, which has no key twice. A key without a value is there.
  [[nodiscard]] bool has(const std::string& key) const;
  [[nodiscard]] YamlPlace at(const std::string& key) const;
  [[nodiscard]] std::vector<std::pair<std::string, YamlPlace>> members() const;
  using Keys = std::initializer_list<std::string_view>;
  /// Any other key is a fault.
  void only(Keys keys) const;
  /// Adds the other keys to the remarks.
  void remark_others(Keys keys, std::vector<std::string>& remarks) const;
  /// Of a list.
  [[nodiscard]] std::vector<YamlPlace> entries() const;

  [[nodiscard]] const std::string& text() const;
  [[nodiscard]] double number() const;
  [[nodiscard]] int integer() const;
  [[nodiscard]] std::int64_t integer64() const;
  /// A list of exactly this many numbers.
  void numbers(std::span<double> out) const;
  /// true or false, as YAML 1.1 also writes them.
  [[nodiscard]] bool flag() const;
  /// A map with exactly x, y and z.
  [[nodiscard]] Eigen::Vector3d xyz() const;
  /// `absent` when there is no such key.
  [[nodiscard]] double number_or(const std::string& key, double absent) const;

  /// The text is faulty here.
  [[noreturn]] void refuse(const std::string& what) const;
  /// The same, with the value. @param rule  e.g. `must be a map`
  [[noreturn]] void refuse_value(const std::string& rule) const;

 private:
  template <typename T>
  [[nodiscard]] T number_of(const char* rule) const;

  YAML::Node node_;
  std::string path_;
};

/// Collects the tags of one text: surveyed, units checked, no id twice.
class ForeignTags final {
 public:
  void add(const KnownTag& tag, const YamlPlace& place);
  /// @param family  empty: not in the file
  [[nodiscard]] ImportedMap take(std::string family, std::vector<std::string> remarks);

 private:
  ImportedTags tags_;
};

/// @param read  reads the whole text
/// @return Error with the line of the first fault
[[nodiscard]] Expected<void> read_yaml(const std::string& text, const std::string& context,
                                       const std::function<void(const YamlPlace&)>& read);

/// The same for a map of another program, of at least one tag, which is checked (checked_import).
[[nodiscard]] Expected<ImportedMap> read_foreign_yaml(
    const std::string& text, const MapImportOptions& options, const std::string& context,
    const std::function<ImportedMap(const YamlPlace&)>& read);

}  // namespace fiducap
