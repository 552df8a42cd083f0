#pragma once

#include <string>
#include <vector>

#include "streaming/operator_api.hpp"

namespace fiducap {

/// Carries out every command and records it.
class FakeOperatorApi : public OperatorApi {
 public:
  std::string operator_token{"correct horse"};
  std::vector<Body> all{
      {1, "drone", true, {Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()}},
      {2, "arm", false, {Eigen::Quaterniond::Identity(), {0.1, 0.2, 0.3}}}};
  MapMode mode{MapMode::kFrozen};
  std::vector<MapChange> changes;
  std::string refusal;  ///< Of every change; empty: none.
  std::shared_ptr<const TagMap> served;
  std::optional<std::string> under_way;
  std::vector<RecordingStatus> known;

  [[nodiscard]] bool admits(std::string_view token) const override {
    return !operator_token.empty() && token == operator_token;
  }
  [[nodiscard]] std::string_view token() const override { return operator_token; }
  [[nodiscard]] std::vector<Body> bodies() const override { return all; }
  Expected<void> set_enabled(int body_id, bool enabled) override {
    return change(body_id, [&](Body& body) { body.enabled = enabled; });
  }
  Expected<void> rename(int body_id, const std::string& name) override {
    if (name.empty()) return fail(ErrorCode::kInvalid, "a name is never empty");
    return change(body_id, [&](Body& body) { body.name = name; });
  }
  Expected<void> set_pivot(int body_id, const Pose& X_BP) override {
    return change(body_id, [&](Body& body) { body.X_BP = X_BP; });
  }
  [[nodiscard]] MapMode map_mode() const override { return mode; }
  Expected<void> set_map_mode(MapMode wanted) override {
    mode = wanted;
    return {};
  }
  Expected<void> change_map(const MapChange& change) override {
    changes.push_back(change);
    return refusal.empty() ? Expected<void>{} : fail(ErrorCode::kInvalid, refusal);
  }
  [[nodiscard]] std::shared_ptr<const TagMap> map() const override { return served; }
  Expected<void> start_recording(const std::string& name) override {
    if (under_way) return fail(ErrorCode::kInvalid, "one is under way");
    under_way = name;
    return {};
  }
  Expected<void> stop_recording() override {
    under_way.reset();
    return {};
  }
  [[nodiscard]] std::optional<std::string> recording() const override { return under_way; }
  [[nodiscard]] std::vector<RecordingStatus> recordings() const override { return known; }

 private:
  template <typename Change>
  Expected<void> change(int body_id, Change&& how) {
    for (auto& body : all) {
      if (body.id != body_id) continue;
      how(body);
      return {};
    }
    return fail(ErrorCode::kNotFound, "no body has the id " + std::to_string(body_id));
  }
};

}  // namespace fiducap
