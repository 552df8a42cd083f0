#include "detection/points/motion_check.hpp"

#include <cstdint>
#include <utility>

namespace fiducap {

namespace {

constexpr int kGuesses = 48;  // with four of ten points moving on their own, all fail once in 10⁹
constexpr std::size_t kFewest = 5;

/// Distance of the later ray from the plane of the shift and the earlier ray, about in units of x
/// and y.
bool is_near(const TurnedPair& pair, const Eigen::Vector3d& normal, const Eigen::Vector3d& shift,
             double limit) {
  const Eigen::Vector3d line = pair.before.cross(shift);
  const double off = shift.dot(normal);
  // Where the ray runs along the shift there is no line, and no disagreement.
  return off * off <= limit * limit * line.head<2>().squaredNorm() ||
         normal.squaredNorm() <= limit * limit;
}

}  // namespace

MotionCheck::MotionCheck(std::size_t usual) {
  normals_.reserve(usual);
  fits_.reserve(usual);
  best_.reserve(usual);
}

std::span<const char> MotionCheck::fitting(std::span<const TurnedPair> pairs, double limit) {
  best_.assign(pairs.size(), 1);
  if (pairs.size() < kFewest) return best_;
  normals_.clear();
  for (const TurnedPair& pair : pairs) normals_.push_back(pair.before.cross(pair.now));
  fits_.resize(pairs.size());
  std::size_t most = 0;
  std::uint32_t random = 12345;
  const auto draw = [&] {
    random = random * 1664525U + 1013904223U;
    return (random >> 8) % pairs.size();
  };
  for (int guess = 0; guess < kGuesses; ++guess) {
    const Eigen::Vector3d shift = normals_[draw()].cross(normals_[draw()]);
    const double length = shift.norm();
    if (!(length > 0)) continue;
    std::size_t count = 0;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      fits_[i] = is_near(pairs[i], normals_[i], shift / length, limit) ? 1 : 0;
      count += static_cast<std::size_t>(fits_[i]);
    }
    if (count <= most) continue;
    most = count;
    std::swap(best_, fits_);
  }
  return best_;
}

}  // namespace fiducap
