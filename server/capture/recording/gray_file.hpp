#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/expected.hpp"
#include "capture/gray_image.hpp"

namespace fiducap {

/// Reads PNG, JPEG or another image file that OpenCV knows into `out`.
/// @param out      its size is the size wanted; another size in the file is an error
/// @param scratch  holds the file; kept by the caller so that its memory is reused
[[nodiscard]] Expected<void> read_gray_file(const std::filesystem::path& file,
                                            std::vector<std::uint8_t>& scratch, GrayImage& out);

/// The same for a camera that is not calibrated yet: `out` gets the size of the file.
[[nodiscard]] Expected<void> read_gray_file_of_any_size(const std::filesystem::path& file,
                                                        std::vector<std::uint8_t>& scratch,
                                                        GrayImage& out);

/// Writes a PNG, lossless and quickly rather than small.
/// @return its size
[[nodiscard]] Expected<std::uint64_t> write_gray_file(const std::filesystem::path& file,
                                                      std::vector<std::uint8_t>& scratch,
                                                      const GrayImage& image);

}  // namespace fiducap
