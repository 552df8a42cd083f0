// Bundles of apriltag_ros.
#include "fuzz/foreign_map.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  fuzz::require_round_trip(MapFormat::kBundles, {reinterpret_cast<const char*>(data), size});
  return 0;
}
