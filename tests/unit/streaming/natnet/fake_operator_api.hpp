#pragma once

#include <optional>
#include <string>
#include <vector>

#include "streaming/operator_api.hpp"

namespace fiducap::natnet {

/// Carries out every command and records it.
class FakeOperatorApi final : public OperatorApi {
 public:
  std::vector<Body> all{
      {1, "arm", true, Pose{}}, {2, "drone", true, Pose{}}, {3, "spare", false, Pose{}}};
  std::optional<std::string> take;
  std::vector<std::string> takes;

  [[nodiscard]] bool admits(std::string_view) const override { return false; }
  [[nodiscard]] std::vector<Body> bodies() const override { return all; }
  Expected<void> set_enabled(int body_id, bool enabled) override {
    Body* body = find(body_id);
    if (body == nullptr) return fail(ErrorCode::kNotFound, "no such body");
    body->enabled = enabled;
    return {};
  }
  Expected<void> rename(int body_id, const std::string& name) override {
    if (name.empty() || name.size() > 64) return fail(ErrorCode::kInvalid, "no name");
    find(body_id)->name = name;
    return {};
  }
  Expected<void> set_pivot(int body_id, const Pose& X_BP) override {
    find(body_id)->X_BP = X_BP;
    return {};
  }
  [[nodiscard]] MapMode map_mode() const override { return MapMode::kMapping; }
  Expected<void> set_map_mode(MapMode) override { return {}; }
  Expected<void> change_map(const MapChange&) override { return {}; }
  Expected<void> start_recording(const std::string& name) override {
    if (take) return fail(ErrorCode::kUnavailable, "one is under way");
    take = name.empty() ? "by date" : name;
    takes.push_back(*take);
    return {};
  }
  Expected<void> stop_recording() override {
    if (!take) return fail(ErrorCode::kUnavailable, "none is under way");
    take.reset();
    return {};
  }
  [[nodiscard]] std::optional<std::string> recording() const override { return take; }
  [[nodiscard]] std::vector<RecordingStatus> recordings() const override { return {}; }

  [[nodiscard]] Body* find(int id) {
    for (auto& body : all) {
      if (body.id == id) return &body;
    }
    return nullptr;
  }
};

}  // namespace fiducap::natnet
