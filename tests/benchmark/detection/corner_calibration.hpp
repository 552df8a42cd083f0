#pragma once

namespace fiducap::bench {

/// Prints how large corner errors are in rendered images, and whether corner_sigma_px says so: the
/// mean of (error / sigma)² in bins of size, shape, sharpness, blur, noise and tilt, on scenes that
/// the model was not fitted to.
void print_corner_calibration(int scenes);

}  // namespace fiducap::bench
