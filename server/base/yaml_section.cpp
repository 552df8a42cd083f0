#include "base/yaml_section.hpp"

#include <algorithm>

#include <Eigen/LU>

#include "base/text.hpp"
#include "base/whole_file.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMaxCalibrationFile_bytes = 16 << 20;
// For rotations that are written with few digits.
constexpr double kRotationTolerance = 1e-2;
constexpr std::size_t kLongestValue = 80;

/// A value for a message: one short line.
std::string shown(const YAML::Node& node) {
  if (node.IsMap() && node.size() > 0) return "{…}";
  if (node.IsSequence() && node.size() > 6) return "[…]";
  YAML::Emitter out;
  out << YAML::Flow << node;
  std::string text = out.c_str();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text.size() <= kLongestValue ? text : text.substr(0, kLongestValue) + "…";
}

/// The pose of a row-major 4 x 4 matrix; Error when the matrix is not rigid.
Expected<Pose> pose_of_matrix(const std::vector<double>& m) {
  if (m.size() != 16)
    return fail(ErrorCode::kInvalid,
                "needs 16 numbers (4 x 4, row by row), has " + std::to_string(m.size()));
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> X(m.data());
  const Eigen::Matrix3d R = X.topLeftCorner<3, 3>();
  if (!((X.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() < 1e-6))
    return fail(ErrorCode::kInvalid, "needs 0 0 0 1 as its last row");
  if (!((R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < kRotationTolerance) ||
      R.determinant() < 0) {
    return fail(ErrorCode::kInvalid, "has no rotation in its upper left 3 x 3");
  }
  return Pose{Eigen::Quaterniond(R).normalized(), X.topRightCorner<3, 1>()};
}

}  // namespace

std::string YamlReading::where(const std::string& path) const {
  for (std::string at = path; !at.empty();) {
    if (is_overridden(at)) return "--set";
    if (const auto found = places.find(at); found != places.end()) return found->second;
    const auto dot = at.rfind('.');
    at = dot == std::string::npos ? "" : at.substr(0, dot);
  }
  return file;
}

YamlSection::YamlSection(const YAML::Node& node, std::string path,
                         std::shared_ptr<YamlReading> reading)
    : node_(node), path_(std::move(path)), reading_(std::move(reading)) {
  if (node_.IsMap() || node_.IsNull()) return;
  reading_->faults.push_back(
      {{path_.empty() ? "file" : path_, shown(node_), "must be a section of `key: value`"},
       reading_->where(path_)});
  node_ = YAML::Node(YAML::NodeType::Map);
}

Expected<YamlSection> YamlSection::load(const std::filesystem::path& path) {
  Expected<std::string> text = read_whole_file(path.string(), kMaxCalibrationFile_bytes);
  if (!text) return tl::unexpected(text.error());
  if (text->starts_with("%YAML")) text->erase(0, text->find('\n'));
  // YAML forbids the tabs with which some programs indent their JSON.
  if (text->starts_with("{")) std::replace(text->begin(), text->end(), '\t', ' ');
  const auto root = load_yaml(*text);
  if (!root) {
    const std::string line = root.error().line > 0 ? ":" + std::to_string(root.error().line) : "";
    return fail(ErrorCode::kInvalid, root.error().text(), path.string() + line);
  }
  if (!root->IsMap())
    return fail(ErrorCode::kInvalid, "is not a YAML map of keys and values", path.string());
  return YamlSection(*root, "", std::make_shared<YamlReading>(YamlReading{path.string()}));
}

YAML::Node YamlSection::take(const std::string& key) const {
  known_.push_back(key);
  YAML::Node node = find(key);
  const std::string path = path_of(key);
  if (node.IsDefined() && !reading_->is_overridden(path))
    reading_->places[path] = reading_->file + ":" + std::to_string(node.Mark().line + 1);
  return node;
}

std::vector<YamlSection> YamlSection::sections(const std::string& key) const {
  std::vector<YamlSection> found;
  const YAML::Node list = take(key);
  if (!list.IsDefined() || list.IsNull()) return found;
  if (!list.IsSequence()) report(key, list, "must be a list");
  for (std::size_t i = 0; list.IsSequence() && i < list.size(); ++i)
    found.push_back(below(list[i], key + "." + std::to_string(i)));
  return found;
}

template <typename T>
std::optional<T> YamlSection::get(const std::string& key) const {
  const YAML::Node node = take(key);
  if (!node.IsDefined() || node.IsNull()) return std::nullopt;
  T value{};
  const Broken broken = read_value(node, value);
  report(key, node, broken);
  if (broken) return std::nullopt;
  return value;
}

std::optional<double> YamlSection::number(const std::string& key) const { return get<double>(key); }

std::optional<int> YamlSection::integer(const std::string& key) const { return get<int>(key); }

std::optional<std::string> YamlSection::text(const std::string& key) const {
  return get<std::string>(key);
}

std::vector<double> YamlSection::numbers(const std::string& key) const {
  std::vector<double> out;
  if (!has(key)) return out;
  const YAML::Node found = take(key);
  if (found.IsMap() && found["data"]) {
    append_numbers(key + ".data", found["data"], 0, out);
  } else {
    append_numbers(key, found, 0, out);
  }
  return out;
}

void YamlSection::append_numbers(const std::string& key, const YAML::Node& node, int depth,
                                 std::vector<double>& out) const {
  constexpr int kMaxDepth = 2;
  double value = 0;
  if (node.IsSequence() && depth < kMaxDepth) {
    for (const YAML::Node& below : node) append_numbers(key, below, depth + 1, out);
  } else if (depth > 0 && !read_value(node, value)) {
    out.push_back(value);
  } else {
    report(key, node, "must be a list of finite numbers");
  }
}

std::optional<Pose> YamlSection::pose(const std::string& key) const {
  if (!has(key)) return std::nullopt;
  const Expected<Pose> X = pose_of_matrix(numbers(key));
  if (X) return *X;
  add_fault(key, X.error().what);
  return std::nullopt;
}

std::vector<double> YamlSection::required_numbers(const std::string& key, std::size_t count) const {
  std::vector<double> values = numbers(key);
  if (!has(key)) {
    add_fault(key, "is missing");
  } else if (values.size() != count) {
    add_fault(key,
              "needs " + std::to_string(count) + " numbers, has " + std::to_string(values.size()));
  }
  values.resize(count);
  return values;
}

void YamlSection::report(const std::string& key, const YAML::Node& node,
                         const Broken& broken) const {
  if (!broken) return;
  const std::string path = path_of(key);
  reading_->faults.push_back({{path, shown(node), *broken}, reading_->where(path)});
}

void YamlSection::refuse_unknown_keys() const {
  if (!node_.IsMap()) return;
  std::set<std::string> given;
  for (const auto& entry : node_) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : shown(entry.first);
    std::string rule;
    if (std::find(known_.begin(), known_.end(), key) == known_.end()) {
      const std::string meant = did_you_mean(key, known_);
      rule = "unknown key; " + meant + (meant.empty() ? "" : " ") + "known here are " +
             comma_list(known_);
    } else if (!given.insert(key).second) {
      rule = "is given twice";
    }
    if (rule.empty()) continue;
    const int line = entry.first.Mark().line + 1;
    const bool set = reading_->is_overridden(path_of(key));
    reading_->faults.push_back({{path_of(key), shown(entry.second), rule},
                                set ? "--set" : reading_->file + ":" + std::to_string(line)});
  }
}

Expected<void> YamlSection::check() const {
  if (reading_->faults.empty()) return {};
  std::string all;
  for (const auto& [error, where] : reading_->faults) {
    all += (all.empty() ? "" : "; ") + error.path + " " + error.rule;
    if (!error.value.empty()) all += ", is " + error.value;
  }
  return fail(ErrorCode::kInvalid, all, reading_->file);
}

}  // namespace fiducap
