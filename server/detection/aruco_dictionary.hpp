#pragma once

#include <cstdint>
#include <vector>

namespace fiducap {

/// The bits of one of OpenCV's predefined ArUco dictionaries.
struct ArucoDictionary {
  int side{};  ///< Bits along one side of the code, without the black border.
  /// One per id: row by row from the top-left of the print, the first bit highest; 1 is white.
  std::vector<std::uint64_t> codes;
};

/// @param number  of OpenCV's `PREDEFINED_DICTIONARY_NAME`
[[nodiscard]] ArucoDictionary aruco_dictionary(int number);

}  // namespace fiducap
