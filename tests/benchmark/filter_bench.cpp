#include <memory>
#include <string>

#include "bench.hpp"
#include "estimation/body_filter.hpp"
#include "tag_wall.hpp"

namespace fiducap::bench {
namespace {

constexpr int kTagsInView = 6;

struct FilterTimes {
  std::vector<double> imu_us;
  std::vector<double> update_us;
  std::size_t tags_in_state{};
};

/// First the tags enter in groups, then `kTagsInView` of them are seen at a time and the clock
/// runs.
FilterTimes time_filter(int tags, int images) {
  Wall wall(tags);
  const auto filter = make_body_filter("robocentric", wall.sensors(), {0, std::nullopt}, {});
  TagObservations seen;
  FilterTimes times;
  int k = 0;
  const auto image = [&](int first, int count, bool measured) {
    auto imu_us = measure(1, 1, [&] {
      for (int i = 0; i < kImuPerImage; ++i) filter->propagate(Wall::imu(k++));
    });
    wall.see(k - 1, first, count, seen);
    auto update_us = measure(1, 1, [&] { (void)filter->update(seen, {}); });
    if (!measured) return;
    times.imu_us.push_back(imu_us.front() / kImuPerImage);
    times.update_us.push_back(update_us.front());
  };
  constexpr int kImagesToEnter = 50;
  for (int i = 0; i < kImagesToEnter; ++i) image(0, kTagsInView, false);  // the motion starts
  for (int first = 0; first < tags; first += kTagsInView)
    for (int i = 0; i < kImagesToEnter; ++i) image(first, kTagsInView, false);
  for (int i = 0; i < images; ++i)
    image(tags <= kTagsInView ? 0 : (7 * i) % (tags - kTagsInView + 1), kTagsInView, true);
  std::vector<TagBelief> beliefs;
  filter->tag_beliefs(beliefs);
  times.tags_in_state = beliefs.size();
  return times;
}

}  // namespace

void bench_filter(const Options& options, std::vector<Row>& rows) {
  std::vector<Row> updates;
  for (const int tags : options.quick ? std::vector{3, 10} : std::vector{3, 10, 20, 40, 100}) {
    FilterTimes times = time_filter(tags, options.repeats(200));
    const std::string remark = std::to_string(times.tags_in_state) + " tags in the state";
    const double per_second = [&] {
      const Row imu = row_of("", "", times.imu_us);
      const Row update = row_of("", "", times.update_us);
      return 1e-6 * (imu.median_us * kImuRate_hz + update.median_us * kImuRate_hz / kImuPerImage);
    }();
    rows.push_back(row_of("propagate, " + std::to_string(tags) + " local tags", "IMU sample",
                          std::move(times.imu_us), remark));
    updates.push_back(row_of(
        "update, " + std::to_string(tags) + " local tags", "image with 6 tags",
        std::move(times.update_us),
        std::to_string(per_second).substr(0, 7) + " s CPU per second of data, IMU included"));
  }
  rows.insert(rows.end(), updates.begin(), updates.end());
}

}  // namespace fiducap::bench
