// fiducap_bench [--quick]: what each stage costs on this machine. CPU time of the thread that does
// the work, except for the latency, which is real time.
#include <cstdio>
#include <cstring>

#include "base/log.hpp"
#include "bench.hpp"

namespace fiducap::bench {

Row row_of(std::string what, std::string per, std::vector<double> times_us, std::string remark) {
  if (times_us.empty()) return {std::move(what), std::move(per), 0, 0, "nothing measured"};
  std::sort(times_us.begin(), times_us.end());
  const auto at = [&](double share) {
    return times_us[static_cast<std::size_t>(share * static_cast<double>(times_us.size() - 1))];
  };
  return {std::move(what), std::move(per), at(0.5), at(0.99), std::move(remark)};
}

namespace {

void print(const std::vector<Row>& rows) {
  std::printf("%-34s %-22s %12s %12s  %s\n", "what", "per", "median [us]", "p99 [us]", "remark");
  for (const Row& row : rows)
    std::printf("%-34s %-22s %12.2f %12.2f  %s\n", row.what.c_str(), row.per.c_str(), row.median_us,
                row.p99_us, row.remark.c_str());
}

}  // namespace
}  // namespace fiducap::bench

int main(int argc, char** argv) {
  using namespace fiducap::bench;
  Options options;
  if (argc == 2 && std::strcmp(argv[1], "--quick") == 0) {
    options.quick = true;
  } else if (argc != 1) {
    std::fprintf(stderr, "usage: fiducap_bench [--quick]\n");
    return 2;
  }
  fiducap::log::set_level(fiducap::log::Level::kWarning);
  std::vector<Row> rows;
  bench_detection(options, rows);
  bench_streaming(options, rows);
  bench_latency(options, rows);
  print(rows);
  return 0;
}
