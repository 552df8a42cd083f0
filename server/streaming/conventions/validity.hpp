#pragma once

#include <string_view>

namespace fiducap {

/// What a client sees of a body whose pose may not be used.
enum class WhenInvalid {
  kFlag,  ///< The body is there, marked invalid by the means of its protocol; its numbers are never stale poses.
  kStop,  ///< The body is absent until it is valid again.
  kHold,  ///< The last valid pose goes on. For clients that cannot bear a gap; not honest, never a default.
};

[[nodiscard]] constexpr std::string_view name_of(WhenInvalid policy) {
  switch (policy) {
    case WhenInvalid::kFlag:
      return "flag";
    case WhenInvalid::kStop:
      return "stop";
    case WhenInvalid::kHold:
      return "hold";
  }
  return "flag";
}

}  // namespace fiducap
