#include "simulation/mismatch_changes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include "base/pose.hpp"
#include "simulation/random.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/sensor_models.hpp"

namespace fiducap::mismatch {

namespace {

using simulation::Purpose;
using simulation::Random;

// Keys of random numbers, apart from those of the simulator.
constexpr std::uint64_t kStamps = 9'001;
constexpr std::uint64_t kDoor = 9'002;
constexpr std::uint64_t kSecondPrint = 9'003;
constexpr std::uint64_t kBlur = 9'004;
constexpr std::uint64_t kMisread = 9'005;

constexpr double kHinge_m = 0.8;
constexpr double kDoorOpens_rad = std::numbers::pi / 3;
constexpr double kDoorPeriod_s = 4;
constexpr double kElsewhere_m = 2.0;
// Corners of a blurred side are off by a tenth of the blur; a tag with a blur of two of its eight
// cells is not read.
constexpr double kSmearFound = 0.1;
constexpr double kSmearRead = 2.0 / 8;
constexpr double kFirstSecond_s = 1.0;
// A tag that was misread comes into view between:
constexpr double kLater_s = 1.1;
constexpr double kLatest_s = 2.6;

/// Sighting of the tag in an image by the rules of the simulator; nullopt: it is not seen.
std::optional<TagSighting> sight(const EstimationData& data, const CornerFrame& image,
                                 const RecordedTag& tag, const simulation::ImageKey& key) {
  const Pose X_WV = camera_at(data, image.exposed_at);
  std::vector<TagSighting> seen;
  simulation::CameraSimulation rules;
  rules.corner_noise_px = data.corner_noise_px;
  sight_corners(
      data.camera.model, [&](double) { return X_WV; }, {tag}, rules, key, seen);
  return seen.empty() ? std::nullopt : std::optional(seen.front());
}

void forget(CornerFrame& image, int tag_id) {
  std::erase_if(image.tags, [&](const TagSighting& t) { return t.tag_id == tag_id; });
}

void sort_by_id(std::vector<TagSighting>& tags) {
  std::sort(tags.begin(), tags.end(),
            [](const TagSighting& a, const TagSighting& b) { return a.tag_id < b.tag_id; });
}

void insert(CornerFrame& image, const TagSighting& tag) {
  image.tags.push_back(tag);
  sort_by_id(image.tags);
}

/// A random pose ahead of the camera at a random time, facing it.
Pose place_ahead(const EstimationData& data, Random& random) {
  const double t_s = random.uniform(0, length_s(data));
  const double ahead_m = random.uniform(1.0, 4.0);
  const double tilt_x = random.uniform(-0.3, 0.3);
  const double tilt_y = random.uniform(-0.3, 0.3);
  const Pose X_WV = camera_at(data, time_of(data.samples.front()) + from_seconds(t_s));
  const Eigen::Quaterniond facing = exp_so3({std::numbers::pi, 0, 0});
  return X_WV * Pose{facing * exp_so3({tilt_x, tilt_y, 0}), {0, 0, ahead_m}};
}

/// Number of images, of every twentieth, that show it.
int count_seen(EstimationData& data, const RecordedTag& tag) {
  constexpr std::size_t kEvery = 20;
  int count = 0;
  for_images(data, [&](CornerFrame& image, std::size_t k, double) {
    if (k % kEvery == 0 && sight(data, image, tag, {kSecondPrint, 0, k})) ++count;
  });
  return count;
}

/// Of some places far from the first print, the one seen most.
RecordedTag second_print(EstimationData& data, const RecordedTag& first, std::uint64_t seed) {
  constexpr int kTries = 60;
  Random random(seed, Purpose::kRoom, kSecondPrint);
  RecordedTag best = first;
  int most = -1;
  for (int i = 0; i < kTries; ++i) {
    RecordedTag tag = first;
    tag.X_WT = place_ahead(data, random);
    if ((tag.X_WT.p - first.X_WT.p).norm() < kElsewhere_m) continue;
    const int seen = count_seen(data, tag);
    if (seen <= most) continue;
    most = seen;
    best = tag;
  }
  return best;
}

/// First time at which each tag of the room is seen.
std::map<int, double> first_seen(EstimationData& data) {
  std::map<int, double> first;
  for_images(data, [&](const CornerFrame& image, std::size_t, double t_s) {
    for (const TagSighting& tag : image.tags) first.try_emplace(tag.tag_id, t_s);
  });
  std::erase_if(first, [&](const auto& one) { return data.tag(one.first) == nullptr; });
  return first;
}

}  // namespace

void for_imu(EstimationData& data, const std::function<void(ImuSample&)>& work) {
  for (SensorSample& sample : data.samples)
    if (auto* imu = std::get_if<ImuSample>(&sample)) work(*imu);
}

Pose camera_at(const EstimationData& data, Instant at) {
  return data.truth_near(at).X_WB * data.camera.X_BV;
}

void for_images(EstimationData& data,
                const std::function<void(CornerFrame&, std::size_t k, double t_s)>& work) {
  const Instant first = time_of(data.samples.front());
  std::size_t k = 0;
  for_each_image(
      data, [&](CornerFrame& image) { work(image, k++, to_seconds(image.exposed_at - first)); });
}

double length_s(const EstimationData& data) {
  return to_seconds(time_of(data.samples.back()) - time_of(data.samples.front()));
}

std::vector<int> often_seen(const EstimationData& data, std::size_t count) {
  std::map<int, int> images;
  for_each_image(data, [&](const CornerFrame& image) {
    for (const TagSighting& tag : image.tags) ++images[tag.tag_id];
  });
  images.erase(data.reference_tag);
  std::vector<int> ids;
  for (const auto& [id, seen] : images) ids.push_back(id);
  std::stable_sort(ids.begin(), ids.end(), [&](int a, int b) { return images[a] > images[b]; });
  ids.resize(std::min(count, ids.size()));
  return ids;
}

void shift_stamps(EstimationData& data, double from_s, double by_s) {
  for_images(data, [&](CornerFrame& image, std::size_t, double t_s) {
    if (t_s >= from_s) image.exposed_at += from_seconds(by_s);
  });
}

void jitter_stamps(EstimationData& data, double sigma_s, std::uint64_t seed) {
  Random random(seed, Purpose::kStampFaults, kStamps);
  const double most_s = 0.45 / data.camera.rate_hz;  // neighbours keep their order
  for_images(data, [&](CornerFrame& image, std::size_t, double) {
    image.exposed_at += from_seconds(std::clamp(sigma_s * random.normal(), -most_s, most_s));
  });
}

void print_larger(EstimationData& data, double factor, std::optional<int> only) {
  if (!only) data.tag_set.size_m /= factor;
  for (auto& [id, size_m] : data.tag_set.sizes_m) size_m /= !only || id == *only ? factor : 1;
}

void lengthen_configured_lens(EstimationData& data, double factor) {
  data.camera.model.fu *= factor;
  data.camera.model.fv *= factor;
}

void move_configured_centre(EstimationData& data, const Eigen::Vector2d& by_px) {
  data.camera.model.cu += by_px.x();
  data.camera.model.cv += by_px.y();
}

void bend_images(EstimationData& data, double k1, double k2) {
  const CameraModel& lens = data.camera.model;
  for_images(data, [&](CornerFrame& image, std::size_t, double) {
    for (TagSighting& tag : image.tags) {
      for (Eigen::Vector2d& px : tag.corners_px) {
        const auto ideal = undistort(lens, px);
        if (!ideal) continue;
        const Eigen::Vector2d from_centre = ideal->px - Eigen::Vector2d(lens.cu, lens.cv);
        const Eigen::Vector2d ray = from_centre.cwiseQuotient(Eigen::Vector2d(lens.fu, lens.fv));
        const double square = ray.squaredNorm();
        px += (k1 + k2 * square) * square * from_centre;
      }
    }
  });
}

void blind(EstimationData& data, double every_s, double length_s) {
  for_images(data, [&](CornerFrame& image, std::size_t, double t_s) {
    if (t_s >= every_s && std::fmod(t_s, every_s) < length_s) image.tags.clear();
  });
}

void show_no_tag(EstimationData& data) {
  for_images(data, [](CornerFrame& image, std::size_t, double) { image.tags.clear(); });
}

void drop_every(EstimationData& data, std::size_t nth) {
  std::size_t k = 0;
  std::erase_if(data.samples, [&](const SensorSample& sample) {
    return std::holds_alternative<CornerFrame>(sample) && ++k % nth == 0;
  });
}

void clip_gyro(EstimationData& data, double share) {
  double most_rad_s = 0;
  for_imu(data, [&](const ImuSample& imu) {
    most_rad_s = std::max(most_rad_s, imu.w_WB_B.cwiseAbs().maxCoeff());
  });
  const double range_rad_s = share * most_rad_s;
  for_imu(data, [&](ImuSample& imu) {
    imu.w_WB_B = imu.w_WB_B.cwiseMax(-range_rad_s).cwiseMin(range_rad_s).eval();
  });
}

void swap_imu_axes(EstimationData& data) {
  for_imu(data, [](ImuSample& imu) {
    std::swap(imu.w_WB_B.x(), imu.w_WB_B.y());
    std::swap(imu.f_B.x(), imu.f_B.y());
  });
}

void turn_configured_camera(EstimationData& data, double angle_rad) {
  data.nominal_X_BV.q = data.nominal_X_BV.q * exp_so3({0, 0, angle_rad});
}

void swap_ids(EstimationData& data, int a, int b, double from_s) {
  for_images(data, [&](CornerFrame& image, std::size_t, double t_s) {
    if (t_s < from_s) return;
    for (TagSighting& tag : image.tags)
      if (tag.tag_id == a || tag.tag_id == b) tag.tag_id = a + b - tag.tag_id;
    sort_by_id(image.tags);
  });
}

void carry(EstimationData& data, int tag_id, double from_s,
           const std::function<Pose(double t_s)>& X_WT, std::uint64_t key) {
  RecordedTag tag = *data.tag(tag_id);
  for_images(data, [&](CornerFrame& image, std::size_t k, double t_s) {
    if (t_s < from_s) return;
    tag.X_WT = X_WT(t_s);
    forget(image, tag_id);
    if (const auto seen = sight(data, image, tag, {key, 0, k})) insert(image, *seen);
  });
}

Pose opened(const Pose& X_WT, double share) {
  const Pose X_TH{Eigen::Quaterniond::Identity(), {kHinge_m, 0, 0}};
  const Pose turn{exp_so3({0, kDoorOpens_rad * share, 0}), Eigen::Vector3d::Zero()};
  return X_WT * X_TH * turn * X_TH.inverse();
}

void hang_on_door(EstimationData& data, int tag_id, double from_s, std::uint64_t seed) {
  const Pose closed = data.tag(tag_id)->X_WT;
  const auto swung = [&](double t_s) {
    const double turns = (t_s - from_s) / kDoorPeriod_s;
    return opened(closed, 0.5 * (1 - std::cos(2 * std::numbers::pi * turns)));
  };
  carry(data, tag_id, from_s, swung, seed + kDoor);
}

void print_again(EstimationData& data, int tag_id, std::uint64_t seed) {
  show_beside(data, second_print(data, *data.tag(tag_id), seed), seed);
}

void show_beside(EstimationData& data, const RecordedTag& print, std::uint64_t seed) {
  for_images(data, [&](CornerFrame& image, std::size_t k, double) {
    const auto seen = sight(data, image, print, {seed + kSecondPrint, 0, k});
    if (!seen) return;
    // As in a detector, an id that appears twice is dropped.
    if (shows(image, print.tag_id)) {
      forget(image, print.tag_id);
    } else {
      insert(image, *seen);
    }
  });
}

void blur(EstimationData& data, double exposure_s, std::uint64_t seed) {
  Random random(seed, Purpose::kCornerFaults, kBlur);
  const Duration half = from_seconds(0.5 * exposure_s);
  const auto smear = [&](CornerFrame& image, TagSighting& seen) {
    const RecordedTag* tag = data.tag(seen.tag_id);
    if (tag == nullptr) return true;
    const Pose before = camera_at(data, image.exposed_at - half).inverse();
    const Pose after = camera_at(data, image.exposed_at + half).inverse();
    const auto corners = simulation::corners_of(*tag);
    const double side_px = (seen.corners_px[1] - seen.corners_px[0]).norm();
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const auto from = data.camera.model.project(before * corners[i]);
      const auto to = data.camera.model.project(after * corners[i]);
      if (!from || !to || (*to - *from).norm() > kSmearRead * side_px) return false;
      seen.corners_px[i] += kSmearFound * random.normal() * (*to - *from);
    }
    return true;
  };
  for_images(data, [&](CornerFrame& image, std::size_t, double) {
    std::vector<TagSighting> read;
    for (TagSighting tag : image.tags)
      if (smear(image, tag)) read.push_back(tag);
    image.tags = std::move(read);
  });
}

int late_tag(const EstimationData& data) {
  EstimationData copy = data;
  int last = data.reference_tag;
  int soonest = data.reference_tag;
  double last_s = 0;
  double soonest_s = std::numeric_limits<double>::infinity();
  for (const auto& [id, t_s] : first_seen(copy)) {
    if (id == data.reference_tag) continue;
    if (t_s >= last_s) {
      last = id;
      last_s = t_s;
    }
    if (t_s >= kLater_s && t_s < soonest_s) {
      soonest = id;
      soonest_s = t_s;
    }
  }
  return soonest != data.reference_tag ? soonest : last;
}

void hide_at_first(EstimationData& data, int tag_id, std::uint64_t seed) {
  if (first_seen(data).at(tag_id) >= kLater_s) return;
  Random random(seed, Purpose::kTagFaults, kMisread);
  const double until_s = random.uniform(kLater_s, kLatest_s);
  for_images(data, [&](CornerFrame& image, std::size_t, double t_s) {
    if (t_s < until_s) forget(image, tag_id);
  });
}

void misread_as(EstimationData& data, int tag_id, std::uint64_t seed) {
  Random random(seed, Purpose::kTagFaults, kMisread, 1);
  std::vector<CornerFrame*> early;
  for_images(data, [&](CornerFrame& image, std::size_t, double t_s) {
    if (t_s < kFirstSecond_s && !image.tags.empty()) early.push_back(&image);
  });
  if (early.empty()) return;
  const auto first = static_cast<std::size_t>(random.below(static_cast<int>(early.size())));
  const auto images = static_cast<std::size_t>(1 + random.below(2));
  const auto which = random.below(1'000);
  for (std::size_t i = first; i < std::min(first + images, early.size()); ++i) {
    auto& tags = early[i]->tags;
    tags[static_cast<std::size_t>(which) % tags.size()].tag_id = tag_id;
    sort_by_id(tags);
  }
}

}  // namespace fiducap::mismatch
