#include "pipeline/body_pose.hpp"

#include <cmath>

namespace fiducap {

double BodyPose::position_sigma_m() const {
  return std::sqrt(covariance.diagonal().segment<3>(0).maxCoeff());
}

double BodyPose::rotation_sigma_rad() const {
  return std::sqrt(covariance.diagonal().segment<3>(3).maxCoeff());
}

}  // namespace fiducap
