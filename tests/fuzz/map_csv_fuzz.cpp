// Tags of other programs, as lines: what is read is written, and read again as the same map.
#include "fuzz/memory_file.hpp"
#include "mapping/formats/map_format.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  const auto map = map_from_csv({reinterpret_cast<const char*>(data), size}, "fuzz");
  if (!map) return 0;
  const auto again = map_from_csv(map_to_csv(*map), "again");
  fuzz::require(again.has_value());
  fuzz::require(content_hash(*again) == content_hash(*map));
  return 0;
}
