#include "paper/mocap.hpp"

#include <random>

#include "base/pose.hpp"

namespace fiducap::bench {

std::vector<PoseDifference> differences_of(const EstimationData& data, const MocapNoise& noise,
                                           std::uint64_t seed) {
  std::mt19937_64 random(seed * 31 + 7);
  std::normal_distribution<double> gauss;
  const auto draw = [&](double sigma) {
    const double x = gauss(random);
    const double y = gauss(random);
    return Eigen::Vector3d(sigma * Eigen::Vector3d(x, y, gauss(random)));
  };
  std::vector<Instant> instants;
  for (const SensorSample& sample : data.samples) {
    if (std::holds_alternative<ImuSample>(sample)) instants.push_back(time_of(sample));
  }
  const auto measured = [&](Instant at) {
    const Pose& X_WB = data.truth_at(at).X_WB;
    return Pose{(X_WB.q * exp_so3(draw(noise.rotation_rad))).normalized(),
                X_WB.p + draw(noise.position_m)};
  };
  std::vector<PoseDifference> out;
  if (instants.size() < 3) return out;
  const Instant first = time_of(data.samples.front());
  Pose before = measured(instants.front());
  for (std::size_t i = 2; i < instants.size(); i += 2) {
    const Pose after = measured(instants[i]);
    const double dt = to_seconds(instants[i] - instants[i - 2]);
    const TruthSample& middle = data.truth_at(instants[i - 1]);
    const Eigen::Quaterniond q_BW = middle.X_WB.q.conjugate();
    out.push_back({to_seconds(middle.at - first), q_BW * (after.p - before.p) / dt,
                   log_so3(before.q.conjugate() * after.q) / dt, q_BW * middle.v_WB,
                   data.rate_at(middle.at)});
    before = after;
  }
  return out;
}

}  // namespace fiducap::bench
