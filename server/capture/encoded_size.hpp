#pragma once

#include <cstddef>
#include <span>

#include "base/expected.hpp"

namespace fiducap {

struct PixelSize {
  int width{};
  int height{};
  bool operator==(const PixelSize&) const = default;
};

/// What a JPEG or PNG says about its own size, read from its header without decoding: an image of a
/// few bytes may ask for gigabytes.
[[nodiscard]] Expected<PixelSize> encoded_size(std::span<const std::byte> image);

}  // namespace fiducap
