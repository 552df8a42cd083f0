#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

/// A frame with bodies `names`, all tracking, in different poses.
inline std::shared_ptr<SceneFrame> make_scene_frame(const std::vector<std::string>& names,
                                                    std::uint64_t number = 1) {
  auto model = std::make_shared<SceneModel>();
  auto frame = std::make_shared<SceneFrame>();
  frame->number = number;
  frame->at = instant_from_ns(5'000'000'000 + static_cast<std::int64_t>(number) * 10'000'000);
  frame->published_at = frame->at;
  frame->utc_offset = Duration{1'700'000'000'000'000'000};
  frame->rate_hz = 100;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double k = static_cast<double>(i);
    model->bodies.push_back({static_cast<int>(i) + 1, names[i]});
    BodyPose body;
    body.body_id = static_cast<int>(i) + 1;
    body.state = BodyState::kTracking;
    body.valid = true;
    body.X_WP = {exp_so3({0.1 + 0.1 * k, -0.2, 0.3}), {1.0 + k, -2.0, 0.5}};
    body.v_WP = {0.5, -0.25, 0.125};
    body.w_WP_P = {0.1, 0.2, 0.3};
    body.covariance = Matrix12d::Identity() * 1e-4;
    body.exposed_at = frame->at - std::chrono::milliseconds(20);
    body.age = std::chrono::milliseconds(20);
    body.tags_in_view = 3;
    body.image_rate_hz = 20;
    frame->bodies.push_back(body);
  }
  frame->model = model;
  frame->map = std::make_shared<TagMap>();
  return frame;
}

/// body0, body1 and so on.
inline std::vector<std::string> numbered_names(int n) {
  std::vector<std::string> names;
  for (int i = 0; i < n; ++i) names.push_back("body" + std::to_string(i));
  return names;
}

}  // namespace fiducap
