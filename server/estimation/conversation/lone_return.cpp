#include "estimation/conversation/lone_return.hpp"

#include <Eigen/Cholesky>

namespace fiducap {

namespace {
// Proven tags are heard after so many images.
constexpr int kAgainst = 5;
// Twice the logarithm of how much likelier one way is than the other: e³ = 20 times.
constexpr double kDecisive = 6.0;
// What a tag alone says of the place in a few images, 1-sigma per axis.
constexpr double kByOneTag_m = 0.05;
}  // namespace

void LoneReturn::begin(int tag_id, const std::optional<BodyPlace>& before,
                       const Eigen::Vector3d& p_WB_now) {
  forget();
  tag_id_ = tag_id;
  before_ = before;
  if (before) moved_W_ = p_WB_now - before->p_WB;
}

LoneReturn::Verdict LoneReturn::contradict(std::span<const int> against,
                                           const std::optional<Eigen::Vector3d>& shift_W) {
  are_several_ |= against.size() > 1 || against_.value_or(against.front()) != against.front();
  against_ = against.front();
  if (shift_W) shifts_W_ += *shift_W;
  said_ += shift_W ? 1 : 0;
  if (++images_against_ < kAgainst) return Verdict::kOpen;
  if (are_several_ || !before_ || said_ == 0) return Verdict::kReturnWrong;
  const Eigen::LLT<Eigen::Matrix3d> P(before_->covariance +
                                      kByOneTag_m * kByOneTag_m * Eigen::Matrix3d::Identity());
  const Eigen::Vector3d by_others = moved_W_ + shifts_W_ / said_;
  const double likelier = by_others.dot(P.solve(by_others)) - moved_W_.dot(P.solve(moved_W_));
  return likelier > kDecisive ? Verdict::kOthersWrong : Verdict::kReturnWrong;
}

}  // namespace fiducap
