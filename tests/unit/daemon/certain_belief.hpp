#pragma once

#include "estimation/known_tag.hpp"

namespace fiducap {

/// A certain tag at (x, 0, 1).
inline TagBelief belief(int id, double x) {
  TagBelief certain;
  certain.tag = {id, 0.16, {Eigen::Quaterniond::Identity(), {x, 0, 1}}};
  certain.tag.covariance = Matrix6d::Identity() * 1e-8;
  certain.sightings = 1000;
  return certain;
}

}  // namespace fiducap
