#pragma once

#include <cstdint>
#include <vector>

#include "capture/gray_image.hpp"

namespace fiducap {

/// Makes an image narrower by averaging, to `width` pixels; one that is not wider is copied.
/// Single-threaded on purpose: OpenCV would lend threads of normal priority to one of low.
/// @param sums  kept for its memory
void scale_down(const GrayImage& image, int width, GrayImage& out, std::vector<float>& sums);

/// @param bytes  replaced; empty when it cannot be encoded
void encode_jpeg(const GrayImage& image, std::vector<std::uint8_t>& bytes);

}  // namespace fiducap
