#include "capture/imu/imu_axes.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <vector>

#include <yaml-cpp/yaml.h>
#include <Eigen/Geometry>

namespace fiducap {

namespace {

constexpr double kUnit = 1e-3;  // what hand-typed digits of a quaternion may leave out
constexpr const char* kAxesRule =
    "must be flu, frd, camera, three axes as [x, -y, -z] that are right-handed (x, y and z once "
    "each; an odd number of minus signs or a swap alone would mirror), or a unit quaternion "
    "[w, x, y, z]";

std::optional<Eigen::RowVector3d> row_of(std::string word) {
  double sign = 1;
  if (word.starts_with('-') || word.starts_with('+')) {
    sign = word.front() == '-' ? -1 : 1;
    word.erase(0, 1);
  }
  if (word.size() != 1 || word[0] < 'x' || word[0] > 'z') return std::nullopt;
  Eigen::RowVector3d row = Eigen::RowVector3d::Zero();
  row[word[0] - 'x'] = sign;
  return row;
}

std::optional<Eigen::Matrix3d> by_axes(std::span<const std::string> words) {
  Eigen::Matrix3d R_BS;
  for (int i = 0; i < 3; ++i) {
    const auto row = row_of(words[static_cast<std::size_t>(i)]);
    if (!row) return std::nullopt;
    R_BS.row(i) = *row;
  }
  // −1: mirrored; 0: an axis twice.
  return R_BS.determinant() == 1 ? std::optional(R_BS) : std::nullopt;
}

std::optional<Eigen::Matrix3d> by_quaternion(std::span<const std::string> words) {
  std::array<double, 4> q{};
  for (std::size_t i = 0; i < 4; ++i) {
    const char* end = words[i].data() + words[i].size();
    const auto [stopped, failure] = std::from_chars(words[i].data(), end, q[i]);
    if (failure != std::errc{} || stopped != end || !std::isfinite(q[i])) return std::nullopt;
  }
  const Eigen::Quaterniond q_BS(q[0], q[1], q[2], q[3]);
  if (std::abs(q_BS.norm() - 1) > kUnit) return std::nullopt;
  return q_BS.normalized().toRotationMatrix();
}

std::string joined(std::span<const std::string> words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "[" : ", ") + word;
  return text + "]";
}

}  // namespace

std::optional<ImuAxes> axes_from(std::span<const std::string> words) {
  using Known = std::pair<std::string_view, std::array<std::string, 3>>;
  static const std::array<Known, 3> kKnown{
      {{"flu", {"x", "y", "z"}}, {"frd", {"x", "-y", "-z"}}, {"camera", {"z", "-x", "-y"}}}};
  std::optional<Eigen::Matrix3d> R_BS;
  for (const auto& [word, axes] : kKnown) {
    if (words.size() == 1 && words[0] == word) return ImuAxes{*by_axes(axes), words[0]};
  }
  if (words.size() == 3) R_BS = by_axes(words);
  if (words.size() == 4) R_BS = by_quaternion(words);
  return R_BS ? std::optional(ImuAxes{*R_BS, joined(words)}) : std::nullopt;
}

std::optional<std::string> read_value(const YAML::Node& node, ImuAxes& out) {
  std::vector<std::string> words;
  if (node.IsScalar()) words.push_back(node.Scalar());
  if (node.IsSequence() && node.size() <= 4) {
    for (const auto& item : node) words.push_back(item.IsScalar() ? item.Scalar() : "");
  }
  const auto axes = axes_from(words);
  if (!axes) return kAxesRule;
  out = *axes;
  return std::nullopt;
}

std::string text_of(const ImuAxes& axes) { return axes.written; }

}  // namespace fiducap
