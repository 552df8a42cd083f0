#pragma once

#include <string>
#include <vector>

#include "daemon/access_keeper.hpp"
#include "daemon/map_keeper.hpp"
#include "daemon/recording/session_recorder.hpp"
#include "scene/scene.hpp"
#include "streaming/operator_api.hpp"

namespace fiducap {

/// Carries out what operators change, on the scene, the map and the recorder.
class OperatorService final : public OperatorApi {
 public:
  /// @param keeper  nullptr: the map has no store
  OperatorService(AccessKeeper& access, Scene& scene, MapBuilder& map, SessionRecorder& recorder,
                  EventBoard& events, MapKeeper* keeper);

  [[nodiscard]] std::string token() const override { return access_.token(); }
  [[nodiscard]] std::string read_token() const override { return access_.read_token(); }
  [[nodiscard]] std::uint64_t tokens_changed() const override { return access_.tokens_changed(); }
  void note_refusal(const Requester& by, const std::string& what, const std::string& why) override {
    access_.note_refusal(by, what, why);
  }
  [[nodiscard]] std::vector<Body> bodies() const override;
  Expected<void> set_enabled(const Requester& by, int body_id, bool enabled) override;
  Expected<void> rename(const Requester& by, int body_id, const std::string& name) override;
  Expected<void> set_pivot(const Requester& by, int body_id, const Pose& X_BP) override;
  [[nodiscard]] MapMode map_mode() const override { return map_.mode(); }
  Expected<void> set_map_mode(const Requester& by, MapMode mode) override;
  Expected<void> change_map(const Requester& by, const MapChange& change) override;
  [[nodiscard]] std::vector<MapVersionInfo> map_versions() const override;
  [[nodiscard]] Expected<std::shared_ptr<const TagMap>> map_version(
      std::int64_t version) const override;
  [[nodiscard]] std::vector<TagFit> tag_fits() const override { return scene_.tag_fits().list(); }
  [[nodiscard]] std::shared_ptr<const TagMap> map() const override { return map_.snapshot(); }
  Expected<void> start_recording(const Requester& by, const std::string& name) override;
  Expected<void> stop_recording(const Requester& by) override;
  [[nodiscard]] std::optional<std::string> recording() const override {
    return recorder_.current();
  }
  [[nodiscard]] std::vector<RecordingStatus> recordings() const override {
    return recorder_.recordings();
  }

 private:
  [[nodiscard]] Expected<std::size_t> index_of(int body_id) const;
  Expected<void> enable(int body_id, bool enabled);
  Expected<void> give_name(int body_id, const std::string& name);
  Expected<void> move_pivot(int body_id, const Pose& X_BP);
  Expected<void> change_mode(MapMode mode);
  Expected<void> change(const CommitVersion& change);
  Expected<void> change(const NameVersion& change);
  Expected<void> change(const RollBack& change);
  Expected<void> change(const AlignMap& change);
  Expected<void> change(const QuarantineTag& change);
  Expected<void> change(const ForgetTag& change);
  Expected<void> ask_keeper(StoreChange change);
  [[nodiscard]] Expected<void> knows_version(std::int64_t version) const;
  void report(const char* kind, std::string text);

  AccessKeeper& access_;
  Scene& scene_;
  MapBuilder& map_;
  SessionRecorder& recorder_;
  EventBoard& events_;
  MapKeeper* keeper_;
  std::vector<std::string> configured_names_;  ///< Subjects of events.
};

}  // namespace fiducap
