// Trajectories and covariances of a run: accepted ones are written, and read again as the same.
#include "fuzz/memory_file.hpp"
#include "tools/replay/run_files.hpp"

FUZZ(tum_fuzz, input) {
  const auto poses = tum_from(input.text(), "fuzz");
  if (!poses) return;
  const auto again = tum_from(to_tum(*poses), "again");
  require(again.has_value() && again->size() == poses->size());
  for (std::size_t i = 0; i < poses->size(); ++i) require((*again)[i].at == (*poses)[i].at);
}

FUZZ(covariance_fuzz, input) {
  const auto read = covariances_from_csv(input.text(), "fuzz");
  if (!read) return;
  const auto again = covariances_from_csv(to_covariance_csv(*read), "again");
  require(again.has_value() && again->size() == read->size());
  for (std::size_t i = 0; i < read->size(); ++i) {
    require((*again)[i].at == (*read)[i].at);
    require((*again)[i].covariance == (*read)[i].covariance);
  }
}
