#pragma once

#include <array>
#include <string_view>

#include "base/config_check.hpp"

namespace fiducap {

/// What a client sees of a body whose pose may not be used.
enum class WhenInvalid {
  /// The body is there, marked invalid by the means of its protocol
  /// (ProtocolConventions::invalid_looks). Its numbers are
  /// what the original server sends beside the mark: none, NaN, or as NatNet the last valid pose. A
  /// client that does not
  /// look at the mark wants kStop.
  kFlag,
  kStop,  ///< The body is absent until it is valid again.
  kHold,  ///< The last valid pose goes on. For clients that cannot bear a gap; not honest, never a
          ///< default.
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

namespace words {

inline constexpr std::array<Word<WhenInvalid>, 3> kWhenInvalid{
    {{"flag", WhenInvalid::kFlag}, {"stop", WhenInvalid::kStop}, {"hold", WhenInvalid::kHold}}};

}  // namespace words

}  // namespace fiducap
