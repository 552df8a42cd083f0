#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "streaming/operator_api.hpp"

namespace fiducap::qualisys {

/// Carries out every command and records it. The token is `open sesame`.
class FakeOperatorApi final : public OperatorApi {
 public:
  std::map<int, bool> enabled;
  std::optional<std::string> running;
  int started{0};
  bool disk_full{false};
  std::vector<RecordingStatus> known;
  RecordingStatus::State stops_as{RecordingStatus::State::kFinished};

  [[nodiscard]] bool admits(std::string_view token) const override {
    return token == "open sesame";
  }
  [[nodiscard]] std::vector<Body> bodies() const override { return {}; }
  Expected<void> set_enabled(int body_id, bool on) override {
    enabled[body_id] = on;
    return {};
  }
  Expected<void> rename(int, const std::string&) override { return {}; }
  Expected<void> set_pivot(int, const Pose&) override { return {}; }
  [[nodiscard]] MapMode map_mode() const override { return MapMode::kFrozen; }
  Expected<void> set_map_mode(MapMode) override { return {}; }
  Expected<void> change_map(const MapChange&) override { return {}; }
  Expected<void> start_recording(const std::string&) override {
    if (disk_full) return fail(ErrorCode::kUnavailable, "the disk is full");
    running = "take_" + std::to_string(++started);
    return {};
  }
  Expected<void> stop_recording() override {
    if (running) known.push_back({*running, stops_as, "", 10, 2000, 0});
    running.reset();
    return {};
  }
  [[nodiscard]] std::optional<std::string> recording() const override { return running; }
  [[nodiscard]] std::vector<RecordingStatus> recordings() const override { return known; }
};

}  // namespace fiducap::qualisys
