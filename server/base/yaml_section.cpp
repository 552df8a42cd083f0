#include "base/yaml_section.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <Eigen/LU>

namespace fiducap {
namespace {

constexpr std::uintmax_t kMaxCalibrationFile_bytes = 16 << 20;
// Written with few digits a rotation is a little off; more than this is a different matrix.
constexpr double kRotationTolerance = 1e-2;

}  // namespace

Expected<std::string> read_calibration_text(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return fail(ErrorCode::kNotFound, "no such file", path.string());
  }
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error || size > kMaxCalibrationFile_bytes) {
    return fail(ErrorCode::kInvalid, "is larger than a calibration file can be (16 MiB)",
                path.string());
  }
  std::ifstream file(path, std::ios::binary);
  std::string text(static_cast<std::size_t>(size), '\0');
  if (!file.read(text.data(), static_cast<std::streamsize>(size))) {
    return fail(ErrorCode::kUnavailable, "cannot be read", path.string());
  }
  return text;
}

Expected<Pose> pose_of_matrix(const std::vector<double>& m) {
  if (m.size() != 16) {
    return fail(ErrorCode::kInvalid,
                "needs 16 numbers (4 x 4, row by row), has " + std::to_string(m.size()));
  }
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> X(m.data());
  const Eigen::Matrix3d R = X.topLeftCorner<3, 3>();
  if (!((X.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() < 1e-6)) {
    return fail(ErrorCode::kInvalid, "needs 0 0 0 1 as its last row");
  }
  if (!((R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < kRotationTolerance) ||
      R.determinant() < 0) {
    return fail(ErrorCode::kInvalid, "has no rotation in its upper left 3 x 3");
  }
  return Pose{Eigen::Quaterniond(R).normalized(), X.topRightCorner<3, 1>()};
}

Expected<YamlSection> YamlSection::load(const std::filesystem::path& path) {
  Expected<std::string> text = read_calibration_text(path);
  if (!text) return tl::unexpected(text.error());
  if (text->starts_with("%YAML")) text->erase(0, text->find('\n'));
  // YAML forbids the tabs with which some programs indent their JSON.
  if (text->starts_with("{")) std::replace(text->begin(), text->end(), '\t', ' ');
  try {
    YAML::Node root = YAML::Load(*text);
    if (!root.IsMap())
      return fail(ErrorCode::kInvalid, "is not a YAML map of keys and values", path.string());
    auto faults = std::make_shared<Faults>();
    faults->file = path.string();
    return YamlSection(std::move(root), "", std::move(faults));
  } catch (const YAML::Exception& broken) {
    return fail(ErrorCode::kInvalid, std::string("is not YAML: ") + broken.what(), path.string());
  }
}

YAML::Node YamlSection::find(const std::string& key) const {
  if (!node_.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
  const YAML::Node& looked_at = node_;  // the const operator does not add the key
  return looked_at[key];
}

bool YamlSection::has(const std::string& key) const {
  if (!node_.IsMap()) return false;
  const YAML::Node found = find(key);
  return found.IsDefined() && !found.IsNull();
}

bool YamlSection::is_map(const std::string& key) const { return has(key) && find(key).IsMap(); }

YamlSection YamlSection::section(const std::string& key) const {
  if (!has(key)) return {YAML::Node(YAML::NodeType::Map), place_ + key + ".", faults_};
  const YAML::Node below = find(key);
  if (!below.IsMap()) complain(key, "must be a map");
  return {below, place_ + key + ".", faults_};
}

std::vector<YamlSection> YamlSection::sections(const std::string& key) const {
  std::vector<YamlSection> below;
  if (!has(key)) return below;
  const YAML::Node list = find(key);
  if (!list.IsSequence()) complain(key, "must be a list");
  for (std::size_t i = 0; list.IsSequence() && i < list.size(); ++i) {
    const std::string name = key + "[" + std::to_string(i) + "]";
    if (list[i].IsMap()) {
      below.push_back({list[i], place_ + name + ".", faults_});
    } else {
      complain(name, "must be a map");
    }
  }
  return below;
}

std::optional<double> YamlSection::number(const std::string& key) const {
  if (!has(key)) return std::nullopt;
  double value = 0;
  if (YAML::convert<double>::decode(find(key), value) && std::isfinite(value)) return value;
  complain(key, "must be a finite number");
  return std::nullopt;
}

std::optional<int> YamlSection::integer(const std::string& key) const {
  if (!has(key)) return std::nullopt;
  int value = 0;
  if (YAML::convert<int>::decode(find(key), value)) return value;
  complain(key, "must be an integer");
  return std::nullopt;
}

std::optional<std::string> YamlSection::text(const std::string& key) const {
  if (!has(key)) return std::nullopt;
  if (find(key).IsScalar()) return find(key).Scalar();
  complain(key, "must be a text");
  return std::nullopt;
}

std::optional<bool> YamlSection::flag(const std::string& key) const {
  if (!has(key)) return std::nullopt;
  bool value = false;
  if (YAML::convert<bool>::decode(find(key), value)) return value;
  complain(key, "must be true or false");
  return std::nullopt;
}

std::vector<double> YamlSection::numbers(const std::string& key) const {
  std::vector<double> out;
  if (!has(key)) return out;
  const YAML::Node found = find(key);
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
  } else if (depth > 0 && YAML::convert<double>::decode(node, value) && std::isfinite(value)) {
    out.push_back(value);
  } else {
    complain(key, "must be a list of finite numbers");
  }
}

std::optional<Pose> YamlSection::pose(const std::string& key) const {
  if (!has(key)) return std::nullopt;
  const Expected<Pose> X = pose_of_matrix(numbers(key));
  if (X) return *X;
  complain(key, X.error().what);
  return std::nullopt;
}

std::vector<std::pair<int, double>> YamlSection::numbers_by_id(const std::string& key) const {
  std::vector<std::pair<int, double>> out;
  if (!has(key)) return out;
  const YAML::Node map = find(key);
  if (!map.IsMap()) {
    complain(key, "must be a map id: number");
    return out;
  }
  for (const auto& entry : map) {
    int id = 0;
    double value = 0;
    if (YAML::convert<int>::decode(entry.first, id) &&
        YAML::convert<double>::decode(entry.second, value)) {
      out.emplace_back(id, value);
    } else {
      complain(key, "must be a map id: number");
    }
  }
  return out;
}

double YamlSection::required_number(const std::string& key) const {
  if (!has(key)) complain(key, "is missing");
  return number(key).value_or(0);
}

int YamlSection::required_integer(const std::string& key) const {
  if (!has(key)) complain(key, "is missing");
  return integer(key).value_or(0);
}

std::vector<double> YamlSection::required_numbers(const std::string& key, std::size_t count) const {
  std::vector<double> values = numbers(key);
  if (!has(key)) {
    complain(key, "is missing");
  } else if (values.size() != count) {
    complain(key,
             "needs " + std::to_string(count) + " numbers, has " + std::to_string(values.size()));
  }
  values.resize(count);
  return values;
}

Pose YamlSection::required_pose(const std::string& key) const {
  if (!has(key)) complain(key, "is missing");
  return pose(key).value_or(Pose{});
}

void YamlSection::complain(const std::string& key, const std::string& text) const {
  faults_->list.push_back(place_ + key + " " + text);
}

Expected<void> YamlSection::check() const {
  if (faults_->list.empty()) return {};
  std::string all;
  for (const std::string& fault : faults_->list) all += (all.empty() ? "" : "; ") + fault;
  return fail(ErrorCode::kInvalid, all, faults_->file);
}

}  // namespace fiducap
