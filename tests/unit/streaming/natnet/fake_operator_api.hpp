#pragma once

#include <string>
#include <vector>

#include "support/fake_operator_api.hpp"

namespace fiducap::natnet {

/// Bodies arm, drone and spare (disabled). A recording without a name is called `by date`.
class FakeOperatorApi final : public fiducap::FakeOperatorApi {
 public:
  FakeOperatorApi() {
    all = {{1, "arm", true, Pose{}}, {2, "drone", true, Pose{}}, {3, "spare", false, Pose{}}};
  }
  std::vector<std::string> takes;

  Expected<void> rename(int body_id, const std::string& name) override {
    if (name.size() > 64) return fail(ErrorCode::kInvalid, "no name");
    return fiducap::FakeOperatorApi::rename(body_id, name);
  }
  Expected<void> start_recording(const std::string& name) override {
    const auto started = fiducap::FakeOperatorApi::start_recording(name.empty() ? "by date" : name);
    if (started) takes.push_back(*under_way);
    return started;
  }
  Expected<void> stop_recording() override {
    if (!under_way) return fail(ErrorCode::kUnavailable, "none is under way");
    return fiducap::FakeOperatorApi::stop_recording();
  }
};

}  // namespace fiducap::natnet
