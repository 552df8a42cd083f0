#pragma once

#include <functional>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/pose.hpp"
#include "mapping/formats/foreign_map.hpp"
#include "mapping/formats/imported_tags.hpp"

namespace fiducap {

/// One value of a YAML text and all below it, free of the parser. No map has a key twice.
struct YamlValue {
  enum class Kind { kEmpty, kText, kList, kMap };
  Kind kind{Kind::kEmpty};
  int line{};                       ///< From 1; 0: not known.
  std::string text{};               ///< Of kText.
  std::vector<std::string> keys{};  ///< Of kMap, beside `values`.
  std::vector<YamlValue> values{};
};

/// First fault of a text. Thrown by what follows and caught by `read_foreign_yaml`, so that the
/// readers of this room stay readable; it leaves the room as an Error.
struct TextFault {
  int line;
  std::string what;
};

/// A value and its path from the top, e.g. `tags.tag7.pose`. Every getter throws TextFault when
/// something else stands there.
class YamlPlace final {
 public:
  YamlPlace(const YamlValue& value, std::string path) : value_(&value), path_(std::move(path)) {}

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] int line() const { return value_->line; }
  /// Path and line, to name it beside another.
  [[nodiscard]] std::string named() const;
  [[nodiscard]] bool is_empty() const { return value_->kind == YamlValue::Kind::kEmpty; }
  [[nodiscard]] bool is_map() const { return value_->kind == YamlValue::Kind::kMap; }

  /// Of a map. A key without a value is there.
  [[nodiscard]] bool has(std::string_view key) const { return find(key) != nullptr; }
  [[nodiscard]] YamlPlace at(std::string_view key) const;
  [[nodiscard]] std::vector<std::pair<std::string, YamlPlace>> members() const;
  /// A key that is none of these is a fault.
  void only(std::initializer_list<std::string_view> keys) const;
  /// Of a list.
  [[nodiscard]] std::vector<YamlPlace> entries() const;

  [[nodiscard]] const std::string& text() const;
  [[nodiscard]] double number() const;
  [[nodiscard]] int integer() const;
  /// true or false, as YAML 1.1 also writes them.
  [[nodiscard]] bool flag() const;
  /// A map with exactly x, y and z.
  [[nodiscard]] Eigen::Vector3d xyz() const;
  /// `absent` when there is no such key.
  [[nodiscard]] double number_or(std::string_view key, double absent) const;

  [[noreturn]] void refuse(const std::string& what) const;

 private:
  [[nodiscard]] const YamlValue* find(std::string_view key) const;
  /// ` = 'what stands there'`.
  [[nodiscard]] std::string found() const;

  const YamlValue* value_;
  std::string path_;
};

/// Collects the tags of one text: surveyed, units checked, no id twice.
class ForeignTags final {
 public:
  void add(const KnownTag& tag, const YamlPlace& place);
  /// @param family  empty: the file does not say
  [[nodiscard]] ImportedMap take(std::string family, std::vector<std::string> remarks);

 private:
  ImportedTags tags_;
};

/// Parses, reads and checks the whole: at least one tag, what makes it doubtful is remarked.
[[nodiscard]] Expected<ImportedMap> read_foreign_yaml(
    const std::string& text, const MapImportOptions& options, const std::string& context,
    const std::function<ImportedMap(const YamlPlace&)>& read);

}  // namespace fiducap
