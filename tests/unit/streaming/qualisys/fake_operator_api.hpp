#pragma once

#include <map>

#include "support/fake_operator_api.hpp"

namespace fiducap::qualisys {

/// The token is `open sesame`; recordings are called take_1, take_2 and so on.
class FakeOperatorApi final : public fiducap::FakeOperatorApi {
 public:
  FakeOperatorApi() { operator_token = "open sesame"; }

  std::map<int, bool> enabled;
  bool disk_full{false};
  RecordingStatus::State stops_as{RecordingStatus::State::kFinished};

  Expected<void> set_enabled(const Requester& by, int body_id, bool on) override {
    requesters.push_back(by);
    enabled[body_id] = on;
    return {};
  }
  Expected<void> start_recording(const Requester& by, const std::string&) override {
    requesters.push_back(by);
    if (disk_full) return fail(ErrorCode::kUnavailable, "the disk is full");
    under_way = "take_" + std::to_string(++started_);
    return {};
  }
  Expected<void> stop_recording(const Requester& by) override {
    if (under_way) known.push_back({*under_way, stops_as, "", 10, 2000, 0});
    return fiducap::FakeOperatorApi::stop_recording(by);
  }

 private:
  int started_{0};
};

}  // namespace fiducap::qualisys
