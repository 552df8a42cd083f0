#pragma once

#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/operator_service.hpp"
#include "daemon/system.hpp"
#include "streaming/web/web.hpp"

namespace fiducap {

/// The map of a server as fiducapd has it, with its store and its operator, and no bodies. Stores
/// nothing by itself: only what somebody asks for.
class ServedMap final {
 public:
  ServedMap(TagMap start, const std::string& folder, std::string token, EventBoard& events)
      : map_(MapConfig{}, std::move(start)),
        keeper_(MapStore::open(folder + "/map.sqlite").value(), map_, kNever_s, clock_, events,
                [] { return std::vector<LearnedBody>{}; }),
        recorder_(RecorderConfig{folder, false}, clock_, events),
        desk_({std::move(token), {}}, scene_, map_, recorder_, events, &keeper_),
        keeping_([this](std::stop_token stop) { keeper_.run(stop); }) {}

  [[nodiscard]] OperatorService& desk() { return desk_; }
  [[nodiscard]] std::shared_ptr<const TagMap> snapshot() const { return map_.snapshot(); }
  void serve(web::WebSources& sources) {
    sources.operator_api = &desk_;
    sources.map_mode = [this] {
      return std::string(desk_.map_mode() == MapMode::kFrozen ? "frozen" : "mapping");
    };
    sources.map_versions = [this] { return desk_.map_versions(); };
    sources.map_version = [this](std::int64_t version) { return desk_.map_version(version); };
  }

 private:
  static constexpr double kNever_s = 1e6;

  SystemClock clock_;
  Scene scene_{std::vector<SceneBody>{}};
  MapBuilder map_;
  MapKeeper keeper_;
  SessionRecorder recorder_;
  OperatorService desk_;
  std::jthread keeping_;
};

}  // namespace fiducap
