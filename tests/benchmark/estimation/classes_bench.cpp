// The simulator's classes beside the open recordings: tags in the images, and the bounds.
#include <algorithm>

#include "estimation/options.hpp"

namespace fiducap::bench {

namespace {

/// Of one recording, or the means over seeds (bounds: RMS).
struct Likeness {
  double seconds{}, path_m{}, tags_per_image{}, empty_percent{}, longest_gap_s{};
  std::vector<double> bound2;  ///< Squared, one per case.
};

Likeness likeness_of(const EstimationData& data, const std::string& cases) {
  Likeness out;
  const Instant first = time_of(data.samples.front());
  const Instant last = time_of(data.samples.back());
  int images = 0;
  int empty = 0;
  std::size_t tags = 0;
  Instant seen = first;
  for_each_image(data, [&](const CornerFrame& image) {
    ++images;
    tags += image.tags.size();
    empty += image.tags.empty() ? 1 : 0;
    if (image.tags.empty()) return;
    out.longest_gap_s = std::max(out.longest_gap_s, to_seconds(image.exposed_at - seen));
    seen = image.exposed_at;
  });
  out.seconds = to_seconds(last - first);
  out.path_m = data.path_m(last);
  out.tags_per_image = static_cast<double>(tags) / images;
  out.empty_percent = 100.0 * empty / images;
  for (const char letter : cases) {
    const double limit = rms(run_bound(data, {letter}), first, &bound::BoundAt::position_m);
    out.bound2.push_back(limit * limit);
  }
  return out;
}

Likeness mean_of(const std::vector<Likeness>& all) {
  Likeness sum;
  sum.bound2.assign(all.front().bound2.size(), 0);
  const double n = static_cast<double>(all.size());
  for (const Likeness& one : all) {
    sum.seconds += one.seconds / n;
    sum.path_m += one.path_m / n;
    sum.tags_per_image += one.tags_per_image / n;
    sum.empty_percent += one.empty_percent / n;
    sum.longest_gap_s = std::max(sum.longest_gap_s, one.longest_gap_s);
    for (std::size_t c = 0; c < sum.bound2.size(); ++c) sum.bound2[c] += one.bound2[c] / n;
  }
  return sum;
}

void add_row(Table& table, const std::string& world, const std::string& source,
             const Likeness& one) {
  table.rows.push_back(cells(world, source, Figure{one.seconds, 0}, Figure{one.path_m, 1},
                             Figure{one.tags_per_image, 2}, Figure{one.empty_percent, 1},
                             Figure{one.longest_gap_s, 2}));
  for (const double square : one.bound2)
    table.rows.back().push_back(Figure{kMm * std::sqrt(square), 2});
}

}  // namespace

std::vector<Table> bench_classes(const EstimationOptions& options) {
  Table table{
      "Classes of motion: what the camera sees, and the bound on position (mm) in the reference "
      "tag's axes",
      {"class", "source", "s", "path m", "tags/image", "empty %", "longest gap s"}};
  for (const char letter : options.cases) table.columns.push_back(std::string("bound ") + letter);
  for (const std::string& world : options.classes) {
    if (const auto open = load_estimation_data(options.data + "/sim_" + world))
      add_row(table, world, "recording", likeness_of(*open, options.cases));
    const auto of_seed = [&](std::uint64_t seed) {
      const double seconds = seconds_of(options, world);
      return likeness_of(simulate({.world = world, .seconds = seconds, .seed = seed}),
                         options.cases);
    };
    add_row(table, world, std::to_string(options.seeds) + " seeds",
            mean_of(for_seeds(options, of_seed)));
  }
  return {table};
}

}  // namespace fiducap::bench
