#pragma once

#include "fiducap/client.hpp"

namespace fiducap::sdk {

/// Whether `ahead` is within Client::kMaxPrediction.
bool may_predict(std::chrono::nanoseconds ahead);

/// Moves a valid body `ahead` in time: constant acceleration in W for the first 0.1 s, then
/// constant velocity; constant body rate in P. Sigmas and covariance grow
/// with those of velocity and rate.
void carry(Body& body, std::chrono::nanoseconds ahead);

}  // namespace fiducap::sdk
