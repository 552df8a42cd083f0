// A map that somebody sent as text: what is read is written, and read again as the same map.
#include "fuzz/memory_file.hpp"
#include "mapping/formats/map_format.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  const std::string text(reinterpret_cast<const char*>(data), size);
  const auto map = map_from_yaml(text, "fuzz");
  if (!map) return 0;
  const std::string written = map_to_yaml(*map);
  const auto again = map_from_yaml(written, "again");
  fuzz::require(again.has_value());
  fuzz::require(content_hash(*again) == content_hash(*map));
  return 0;
}
