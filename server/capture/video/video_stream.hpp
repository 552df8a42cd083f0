#pragma once

#include <memory>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/gray_image.hpp"

namespace fiducap::video {

/// Images one after the other, as a decoder gives them.
class VideoStream {
 public:
  virtual ~VideoStream() = default;
  /// Goes to the next image. @return false when there is none
  [[nodiscard]] virtual bool grab() = 0;
  /// Where the image grabbed last stands in its file; negative: the file does not say.
  [[nodiscard]] virtual Duration place() const = 0;
  /// The image grabbed last; null when it cannot be decoded.
  [[nodiscard]] virtual Expected<std::shared_ptr<const GrayImage>> image() = 0;
  /// Begins a file anew. @return false when that does not work
  [[nodiscard]] virtual bool rewind() = 0;
};

}  // namespace fiducap::video
