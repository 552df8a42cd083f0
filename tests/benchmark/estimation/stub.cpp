#include "estimation/options.hpp"
namespace fiducap::bench {
std::vector<Table> bench_cpu(const EstimationOptions&) { return {}; }
std::vector<Table> bench_outages(const EstimationOptions&) { return {}; }
std::vector<Table> bench_faults(const EstimationOptions&) { return {}; }
}  // namespace fiducap::bench
