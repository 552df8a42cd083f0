#pragma once

#include <cstdint>

#include "capture/lens/camera_model.hpp"
#include "simulation/estimation_data.hpp"

namespace fiducap {

/// A lens as a calibration would tell it: all its numbers a little off, so that over the image
/// corners are off by `rms_px` of each coordinate, what a turn of the camera does taken out.
[[nodiscard]] CameraModel told_lens(const CameraModel& lens, double rms_px, std::uint64_t seed);

/// A body with such a lens, whose corners scatter as little as those of images. @param told_px what
/// the lens is said to be off, with the sigmas of its numbers that belong to it; 0: exact
[[nodiscard]] EstimationData behind_a_told_lens(SimulatedDataSetup setup, double error_px,
                                                double told_px);

}  // namespace fiducap
