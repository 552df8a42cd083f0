// Trajectories of other programs: what is read is written, and read again as the same.
#include "fuzz/memory_file.hpp"
#include "tools/replay/trajectory_files.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  const auto poses = tum_from({reinterpret_cast<const char*>(data), size}, "fuzz");
  if (!poses) return 0;
  const auto again = tum_from(to_tum(*poses), "again");
  fuzz::require(again.has_value() && again->size() == poses->size());
  for (std::size_t i = 0; i < poses->size(); ++i) fuzz::require((*again)[i].at == (*poses)[i].at);
  return 0;
}
