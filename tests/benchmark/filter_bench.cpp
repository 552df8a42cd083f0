#include <cmath>
#include <memory>
#include <random>
#include <string>

#include "base/so3.hpp"
#include "bench.hpp"
#include "detection/tag_pose.hpp"
#include "estimation/body_filter.hpp"

namespace fiducap::bench {
namespace {

constexpr double kImuRate_hz = 200;
constexpr int kImuPerImage = 10;
constexpr int kTagsInView = 6;
constexpr double kEdge_m = 0.2;
constexpr double kCornerNoise_px = 0.4;

/// A camera that sways in front of a wall with up to 100 tilted tags. Everything is known, so any
/// of them can be shown.
class Wall final {
 public:
  explicit Wall(int tags) {
    camera_.model = {752, 480, 460, 460, 376, 240, Distortion::kNone, {}};
    Eigen::Matrix3d R_BV;  // camera z along body x
    R_BV << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    camera_.X_BV = {Eigen::Quaterniond(R_BV), {0.05, 0, 0}};
    Eigen::Matrix3d facing;  // tag z against x, tag y up
    facing << 0, 0, -1, -1, 0, 0, 0, 1, 0;
    for (int i = 0; i < tags; ++i) {
      const double y = 0.32 * (i % 10 - 4.5);
      const double z = 0.26 * (i / 10 - 4.5);
      const Eigen::Vector3d tilt(0.45 * std::sin(1.7 * i), 0.5 + 0.2 * std::cos(2.3 * i), 0.1 * i);
      X_WT_.push_back({Eigen::Quaterniond(facing) * exp_so3(tilt), {3, y, z}});
    }
  }

  [[nodiscard]] BodySensors sensors() const {
    return {{camera_}, ImuNoise{1.2e-4, 2e-5, 2.3e-3, 5e-4, kImuRate_hz}};
  }

  [[nodiscard]] static ImuSample imu(int k) {
    const double t = k / kImuRate_hz;
    const Eigen::Vector3d a =
        -sway().cwiseProduct(speed().cwiseProduct(speed())).cwiseProduct(sines(t));
    return {instant(t), Eigen::Vector3d::Zero(), a + Eigen::Vector3d(0, 0, 9.81)};
  }

  /// `count` tags from number `first` on, at the instant of IMU sample k.
  void see(int k, int first, int count, TagObservations& seen) {
    const double t = k / kImuRate_hz;
    seen.camera = 0;
    seen.exposed_at = instant(t);
    seen.tags.clear();
    const Pose X_VW = (Pose{Eigen::Quaterniond::Identity(), sway().cwiseProduct(sines(t))} * camera_.X_BV).inverse();
    for (int i = first; i < first + count && i < static_cast<int>(X_WT_.size()); ++i) {
      TagObservation tag;
      tag.tag_id = i;
      tag.edge_m = kEdge_m;
      for (int c = 0; c < 4; ++c) {
        const auto corner = static_cast<std::size_t>(c);
        tag.corners_px[corner] = camera_.model.pinhole(
            X_VW * (X_WT_[static_cast<std::size_t>(i)] * tag_corner(c, kEdge_m)));
        tag.corners_px[corner] +=
            kCornerNoise_px * Eigen::Vector2d(noise_(random_), noise_(random_));
        tag.ideal_from_raw[corner].setIdentity();
      }
      seen.tags.push_back(tag);
    }
  }

 private:
  static Instant instant(double t) { return instant_from_ns(0) + from_seconds(t); }
  static Eigen::Vector3d sway() { return {0.15, 0.2, 0.1}; }
  static Eigen::Vector3d speed() { return {1.3, 1.7, 2.1}; }
  static Eigen::Vector3d sines(double t) { return (speed() * t).array().sin(); }

  CameraMount camera_;
  std::vector<Pose> X_WT_;
  std::mt19937 random_{1};
  std::normal_distribution<double> noise_;
};

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
