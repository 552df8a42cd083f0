// Field layouts of WPILib. The first byte chooses the size of the tags, which is not in the file.
#include "fuzz/memory_file.hpp"
#include "mapping/formats/map_format.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  const fuzz::Chosen input(data, size, 4);
  constexpr std::array<double, 4> kEdges_m{0.1651, 0, -1, 1e308};
  const auto map = map_from_wpilib_json(input.text(), kEdges_m[input.which], "fuzz");
  if (!map) return 0;
  fuzz::require(!fault_in(*map) && map_from_yaml(map_to_yaml(*map), "again").has_value());
  const auto written = map_to_wpilib_json(*map, std::nullopt).text;
  fuzz::require(map_from_wpilib_json(written, kEdges_m[input.which], "again").has_value());
  return 0;
}
