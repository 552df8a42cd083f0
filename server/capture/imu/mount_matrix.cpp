#include "capture/imu/mount_matrix.hpp"

#include <charconv>
#include <cmath>

namespace fiducap {

std::optional<Eigen::Matrix3d> parse_mount_matrix(std::string_view text) {
  constexpr double kOrthonormal = 0.01;  // hand-written figures
  constexpr std::string_view kBetween = " ,;\n\t";
  Eigen::Matrix3d matrix;
  for (int i = 0; i < 9; ++i) {
    text.remove_prefix(std::min(text.find_first_not_of(kBetween), text.size()));
    double value = 0;
    const auto [stopped, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (failure != std::errc{} || !std::isfinite(value)) return std::nullopt;
    text.remove_prefix(static_cast<std::size_t>(stopped - text.data()));
    matrix(i / 3, i % 3) = value;
  }
  const bool is_over = text.find_first_not_of(kBetween) == std::string_view::npos;
  const double off = (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).norm();
  return is_over && off < kOrthonormal ? std::optional(matrix) : std::nullopt;
}

}  // namespace fiducap
