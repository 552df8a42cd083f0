// The table of an IMU, with any header.
#include "capture/import/imu_csv.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  static const fuzz::MemoryFile file;
  file.put(std::as_bytes(std::span(data, size)));
  const auto table = read_imu_csv(file.path(), {});
  if (!table) return 0;
  fuzz::require(table->samples.size() <= size);
  for (std::size_t i = 1; i < table->samples.size(); ++i)
    fuzz::require(table->samples[i].sampled_at > table->samples[i - 1].sampled_at);
  return 0;
}
