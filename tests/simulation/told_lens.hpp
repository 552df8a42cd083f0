#pragma once

#include <cstdint>

#include "capture/lens/camera_model.hpp"
#include "simulation/estimation_data.hpp"

namespace fiducap {

/// Result of a calibration of a lens: parameters with errors that move corners by `rms_px` per
/// coordinate over the image, without the effect of a rotation.
[[nodiscard]] CameraModel told_lens(const CameraModel& lens, double rms_px, std::uint64_t seed);

/// A body with such a lens, with corner noise as in images. @param told_px  configured lens error,
/// with matching sigmas of its parameters; 0: exact
[[nodiscard]] EstimationData behind_a_told_lens(SimulatedDataSetup setup, double error_px,
                                                double told_px);

}  // namespace fiducap
