#pragma once

#include <string>
#include <vector>

#include "simulation/simulation.hpp"
#include "support/lens_models.hpp"

namespace fiducap::simulation {

/// The camera of the simulated classes of data/: 752 × 480, f = 460 px.
inline CameraModel plain_camera() { return {752, 480, 460, 460, 375.5, 239.5}; }

/// A lens with about 60 px of barrel distortion in the image corner.
inline CameraModel lens_camera() {
  return radial_tangential({752, 480, 460, 458, 367.2, 248.4}, {-0.28, 0.07, 2e-4, 2e-5});
}

/// A robot without images.
inline SimulatedBodyConfig corner_robot(const std::string& kind, std::uint64_t seed = 1) {
  SimulatedBodyConfig body;
  body.camera.images = false;
  body.trajectory.kind = kind;
  body.trajectory.seed = seed;
  body.seed = seed;
  CameraMount mount;
  mount.model = plain_camera();
  mount.X_BV = forward_camera() * Pose{Eigen::Quaterniond(0.9998, 0.01, -0.01, 0.014).normalized(),
                                       {0.05, -0.01, 0.02}};
  body.cameras = {mount};
  return body;
}

/// A tag that faces z.
inline RecordedTag tag_at(int id, double edge_m,
                          const Eigen::Vector3d& p = Eigen::Vector3d::Zero()) {
  RecordedTag tag;
  tag.tag_id = id;
  tag.edge_m = edge_m;
  tag.X_WT.p = p;
  return tag;
}

inline RoomConfig room_of(const std::string& preset) {
  RoomConfig room;
  room.preset = preset;
  return room;
}

/// Everything the source gives within the body's duration. @pre duration_s > 0
inline std::vector<SensorSample> run_out(SimulatedSource& source) {
  std::vector<SensorSample> samples;
  while (auto sample = source.next({}).value()) samples.push_back(std::move(*sample));
  return samples;
}

template <typename T>
std::vector<T> only(const std::vector<SensorSample>& samples) {
  std::vector<T> found;
  for (const SensorSample& sample : samples)
    if (const auto* one = std::get_if<T>(&sample)) found.push_back(*one);
  return found;
}

}  // namespace fiducap::simulation
