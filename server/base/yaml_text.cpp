#include "base/yaml_text.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include <yaml-cpp/eventhandler.h>

namespace fiducap {
namespace {

// Cameras of many bodies that share a calibration repeat some hundred values; nothing is deeper
// than ten levels.
constexpr std::size_t kMostRepeated = 10'000;
constexpr std::size_t kDeepest = 100;

/// Follows a text, before it becomes nodes, and adds up what its aliases repeat.
class AliasCheck final : public YAML::EventHandler {
 public:
  [[nodiscard]] const std::optional<YamlFault>& fault() const { return fault_; }

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t anchor) override { add_value("", anchor); }
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t anchor,
                const std::string& value) override {
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
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override;

 private:
  struct Size {
    std::size_t values{1};
    std::size_t levels{1};
  };
  /// A list or map whose end has not come yet.
  struct Open {
    bool is_map{};
    YAML::anchor_t anchor{};
    std::size_t entries{0};  ///< Of a map, keys count too.
    std::string key{};
    Size size{};
  };

  void open(const YAML::Mark& mark, bool is_map, YAML::anchor_t anchor);
  void close();
  void add_value(const std::string& value, YAML::anchor_t anchor);
  void begin_entry(const std::string& value);
  void add(const Size& size);
  void complain(const YAML::Mark& mark, const std::string& value, const std::string& rule);
  [[nodiscard]] std::string path() const;

  std::vector<Open> open_;
  std::map<YAML::anchor_t, Size> anchored_;
  std::size_t repeated_{0};
  std::optional<YamlFault> fault_;
};

void AliasCheck::open(const YAML::Mark& mark, bool is_map, YAML::anchor_t anchor) {
  begin_entry("?");
  open_.push_back({is_map, anchor});
  if (open_.size() > kDeepest) complain(mark, "", "is deeper than 100 levels");
}

void AliasCheck::close() {
  const Open done = std::move(open_.back());
  open_.pop_back();
  if (done.anchor != YAML::NullAnchor) anchored_[done.anchor] = done.size;
  add(done.size);
}

void AliasCheck::add_value(const std::string& value, YAML::anchor_t anchor) {
  begin_entry(value);
  if (anchor != YAML::NullAnchor) anchored_[anchor] = {};
  add({});
}

void AliasCheck::OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) {
  begin_entry("?");
  const auto found = anchored_.find(anchor);
  if (found == anchored_.end())
    return complain(mark, "an alias", "repeats the list or section that it stands in");
  repeated_ += found->second.values;
  if (repeated_ > kMostRepeated)
    return complain(mark, "an alias", "aliases repeat more than 10000 values");
  if (open_.size() + found->second.levels > kDeepest)
    return complain(mark, "an alias", "is deeper than 100 levels");
  add(found->second);
}

/// In a map, key and value come by turns.
void AliasCheck::begin_entry(const std::string& value) {
  if (open_.empty()) return;
  Open& around = open_.back();
  if (around.is_map && around.entries % 2 == 0) around.key = value;
  ++around.entries;
}

void AliasCheck::add(const Size& size) {
  if (open_.empty()) return;
  Size& around = open_.back().size;
  around.values += size.values;
  around.levels = std::max(around.levels, size.levels + 1);
}

void AliasCheck::complain(const YAML::Mark& mark, const std::string& value,
                          const std::string& rule) {
  if (!fault_) fault_ = YamlFault{mark.line + 1, path(), value, rule};
}

std::string AliasCheck::path() const {
  std::string path;
  for (const Open& level : open_) {
    const std::string step = level.is_map         ? level.key
                             : level.entries == 0 ? ""
                                                  : std::to_string(level.entries - 1);
    if (!step.empty()) path += (path.empty() ? "" : ".") + step;
  }
  return path;
}

YamlFault not_yaml(const YAML::Exception& broken) {
  return {broken.mark.is_null() ? 0 : broken.mark.line + 1, "", "", "is not YAML: " + broken.msg};
}

}  // namespace

std::string YamlFault::text() const {
  return path + (value.empty() ? "" : " = " + value) + (path.empty() ? "" : ": ") + rule;
}

tl::expected<YAML::Node, YamlFault> load_yaml(const std::string& text) {
  try {
    if (text.find('*') != std::string::npos) {  // else there is no alias
      std::istringstream stream(text);
      AliasCheck check;
      YAML::Parser(stream).HandleNextDocument(check);
      if (check.fault()) return tl::unexpected(*check.fault());
    }
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.size() > 1)
      return tl::unexpected(
          YamlFault{0, "", "",
                    "holds " + std::to_string(documents.size()) +
                        " documents: only the first would be read; strike the line ---"});
    return documents.empty() ? YAML::Node() : documents.front();
  } catch (const YAML::Exception& broken) {
    return tl::unexpected(not_yaml(broken));
  }
}

}  // namespace fiducap
