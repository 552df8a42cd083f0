// Covariances of a run: what is read is written, and read again as the same.
#include "fuzz/memory_file.hpp"
#include "tools/replay/trajectory_files.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  const auto read = covariances_from_csv({reinterpret_cast<const char*>(data), size}, "fuzz");
  if (!read) return 0;
  const auto again = covariances_from_csv(to_covariance_csv(*read), "again");
  fuzz::require(again.has_value() && again->size() == read->size());
  for (std::size_t i = 0; i < read->size(); ++i) {
    fuzz::require((*again)[i].at == (*read)[i].at);
    fuzz::require((*again)[i].covariance == (*read)[i].covariance);
  }
  return 0;
}
