#include "example_room.hpp"

#include <algorithm>
#include <cmath>

#include "base/pose.hpp"
#include "example_tags.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {

ExampleRoom::ExampleRoom(Setup setup) : setup_(std::move(setup)), random_(setup_.seed) {
  CameraMount mount;
  mount.model = example_camera();
  mount.X_BV = {exp_so3({-kQuarterTurn, 0, 0}), {0.05, 0.02, -0.03}};
  mount.time_shift_sigma_s = 0.02;
  sensors_.cameras = {mount};
  sensors_.imu = ImuNoise{};
  sensors_.imu->rate_hz = 1.0 / setup_.imu_period_s;
  imu_on = setup_.has_imu;
  if (!setup_.has_imu) sensors_.imu.reset();
  for (int i = 0; i < 6; ++i) {
    tags[i] = {exp_so3({0, 0, 0.35 * std::pow(-1.0, i)}) *
                   exp_so3({kQuarterTurn + 0.3 * std::pow(-1.0, i / 2), 0, 0}),
               {-1.0 + 0.4 * i, 2.0, 1.1 + 0.25 * (i % 3)}};
  }
  filter = make_body_filter(setup_.filter, sensors_, setup_.gauge, setup_.estimator);
}

Pose ExampleRoom::X_RB(double t) {
  return {
      exp_so3({0.12 * std::sin(1.3 * t), 0.1 * std::sin(0.9 * t + 0.4), 0.15 * std::sin(0.8 * t)}),
      {0.35 * std::sin(1.1 * t), 0.25 * std::sin(0.7 * t + 1.0), 1.2 + 0.15 * std::sin(1.7 * t)}};
}

UpdateReport ExampleRoom::next_image(const MapKnowledge& map, const std::vector<int>& visible) {
  const double image_s = t_s + setup_.image_period_s;
  while (imu_on && imu_s < image_s) {
    imu_s += setup_.imu_period_s;
    filter->propagate(reading(imu_s));
  }
  t_s = image_s;
  if (!imu_on) imu_s = t_s;
  MapKnowledge knowledge = map;
  if (knowledge.whole == nullptr) knowledge.whole = whole_of(map.tags);
  return filter->update(look(visible), knowledge);
}

const KnownMap* ExampleRoom::whole_of(std::span<const KnownTag> map) {
  const auto same = [](const KnownTag& a, const KnownTag& b) {
    return a.tag_id == b.tag_id && a.X_WT.p == b.X_WT.p && a.X_WT.q.coeffs() == b.X_WT.q.coeffs() &&
           a.covariance == b.covariance;
  };
  if (std::ranges::equal(map, whole_.uncorrelated, same)) return &whole_;
  whole_.uncorrelated.assign(map.begin(), map.end());
  ++whole_.revision;
  return &whole_;
}

UpdateReport ExampleRoom::images(int count, const MapKnowledge& map,
                                 const std::vector<int>& visible) {
  UpdateReport report;
  for (int i = 0; i < count; ++i) report = next_image(map, visible);
  return report;
}

TagObservations ExampleRoom::look(const std::vector<int>& visible) {
  TagObservations out;
  out.exposed_at = at(t_s);
  const CameraMount& mount = sensors_.cameras.front();
  const Pose X_VR = (truth() * mount.X_BV).inverse();
  for (const auto& [id, X_RT] : tags) {
    const bool is_visible = visible.empty() || std::ranges::find(visible, id) != visible.end();
    if (is_visible)
      out.tags.push_back(
          noisy_observation(id, edge_m, X_VR * X_RT, mount.model, setup_.pixel_sigma, random_));
  }
  return out;
}

ImuSample ExampleRoom::reading(double t) {
  constexpr double h = 1e-3;
  const Pose before = X_RB(t - h);
  const Pose now = X_RB(t);
  const Pose after = X_RB(t + h);
  const Eigen::Vector3d a = (after.p - 2 * now.p + before.p) / (h * h);
  const ImuNoise& noise = *sensors_.imu;
  const double rate = std::sqrt(1.0 / setup_.imu_period_s);
  std::normal_distribution<double> gauss;
  const auto white = [&](double density) -> Eigen::Vector3d {
    return Eigen::Vector3d(gauss(random_), gauss(random_), gauss(random_)) * density * rate;
  };
  return {
      at(t), log_so3(before.q.conjugate() * after.q) / (2 * h) + white(noise.gyro_noise_rad_s_rtHz),
      now.q.conjugate() * (a + Eigen::Vector3d(0, 0, 9.81)) + white(noise.accel_noise_m_s2_rtHz)};
}

double ExampleRoom::error_m(const Pose& X_WR) const {
  return (filter->estimate().X_WB.p - (X_WR * truth()).p).norm();
}

double ExampleRoom::sigma_m() const {
  return std::sqrt(filter->estimate().covariance.diagonal().head<3>().sum());
}

double ExampleRoom::pose_nees() const {
  const BodyEstimate body = filter->estimate();
  Vector6d off;
  off << body.X_WB.p - truth().p, log_so3(body.X_WB.q * truth().q.conjugate());
  return squared_distance(off, body.covariance.topLeftCorner<6, 6>()) / 6;
}

std::vector<KnownTag> ExampleRoom::known_all(double sigma) const {
  std::vector<KnownTag> out;
  for (const auto& [id, X_RT] : tags) out.push_back(known(id, X_RT, sigma));
  return out;
}

std::vector<TagBelief> ExampleRoom::beliefs() const {
  std::vector<TagBelief> out;
  filter->tag_beliefs(out);
  return out;
}

std::optional<TagBelief> ExampleRoom::belief(int tag_id) const {
  for (const TagBelief& belief : beliefs())
    if (belief.tag.tag_id == tag_id) return belief;
  return std::nullopt;
}

void ExampleRoom::expect_belief(int tag_id, double within_m, const Pose& X_WR) const {
  const auto found = belief(tag_id);
  ASSERT_TRUE(found) << "tag " << tag_id;
  EXPECT_LT((found->tag.X_WT.p - (X_WR * tags.at(tag_id)).p).norm(), within_m) << tag_id;
}

bool names(const UpdateReport& report, int tag_id) {
  const int named = std::min(report.tags_dropped, static_cast<int>(UpdateReport::kMostNamed));
  const auto end = report.dropped_tags.begin() + named;
  return std::find(report.dropped_tags.begin(), end, tag_id) != end;
}

void erase_tag(std::vector<KnownTag>& map, int tag_id) {
  std::erase_if(map, [&](const KnownTag& tag) { return tag.tag_id == tag_id; });
}

}  // namespace fiducap
