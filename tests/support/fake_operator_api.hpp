#pragma once

#include <string>
#include <vector>

#include "streaming/operator_api.hpp"

namespace fiducap {

/// Carries out every command and records it.
class FakeOperatorApi : public OperatorApi {
 public:
  std::string operator_token{"correct horse"};
  std::string reader_token;
  std::uint64_t changes_of_tokens{0};
  std::vector<Requester> requesters;  ///< Of each change.
  std::vector<std::string> refused;
  std::vector<Body> all{
      {1, "drone", true, {Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()}},
      {2, "arm", false, {Eigen::Quaterniond::Identity(), {0.1, 0.2, 0.3}}}};
  MapMode mode{MapMode::kFrozen};
  std::vector<MapChange> changes;
  std::string refusal;  ///< Of every change; empty: none.
  std::shared_ptr<const TagMap> served;
  std::optional<std::string> under_way;
  std::vector<RecordingStatus> known;

  [[nodiscard]] std::string token() const override { return operator_token; }
  [[nodiscard]] std::string read_token() const override { return reader_token; }
  [[nodiscard]] std::uint64_t tokens_changed() const override { return changes_of_tokens; }
  void note_refusal(const Requester& by, const std::string& what, const std::string& why) override {
    refused.push_back(by.address + " (" + std::string(by.protocol) + ") " + what + ": " + why);
  }
  [[nodiscard]] std::vector<Body> bodies() const override { return all; }
  Expected<void> set_enabled(const Requester& by, int body_id, bool enabled) override {
    requesters.push_back(by);
    return change(body_id, [&](Body& body) { body.enabled = enabled; });
  }
  Expected<void> rename(const Requester& by, int body_id, const std::string& name) override {
    requesters.push_back(by);
    if (name.empty()) return fail(ErrorCode::kInvalid, "a name is never empty");
    return change(body_id, [&](Body& body) { body.name = name; });
  }
  Expected<void> set_pivot(const Requester& by, int body_id, const Pose& X_BP) override {
    requesters.push_back(by);
    return change(body_id, [&](Body& body) { body.X_BP = X_BP; });
  }
  [[nodiscard]] MapMode map_mode() const override { return mode; }
  Expected<void> set_map_mode(const Requester& by, MapMode wanted) override {
    requesters.push_back(by);
    mode = wanted;
    return {};
  }
  Expected<void> change_map(const Requester& by, const MapChange& change) override {
    requesters.push_back(by);
    changes.push_back(change);
    return refusal.empty() ? Expected<void>{} : fail(ErrorCode::kInvalid, refusal);
  }
  [[nodiscard]] std::shared_ptr<const TagMap> map() const override { return served; }
  Expected<void> start_recording(const Requester& by, const std::string& name) override {
    requesters.push_back(by);
    if (under_way) return fail(ErrorCode::kInvalid, "one is under way");
    under_way = name;
    return {};
  }
  Expected<void> stop_recording(const Requester& by) override {
    requesters.push_back(by);
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
