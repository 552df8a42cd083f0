// TagSLAM's bodies and their tags.
#include "fuzz/foreign_map.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  fuzz::require_round_trip(MapFormat::kTagslam, {reinterpret_cast<const char*>(data), size});
  return 0;
}
