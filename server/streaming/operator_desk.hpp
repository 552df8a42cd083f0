#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/pose.hpp"
#include "mapping/map_builder.hpp"
#include "mapping/map_change.hpp"
#include "mapping/store/map_rows.hpp"
#include "scene/tag_fits.hpp"

namespace fiducap {

/// Who may change the server's state over a protocol that knows no password.
enum class RemoteControl { kOff, kLoopback, kAll };

/// How a recording goes, or how it went.
struct RecordingStatus {
  enum class State { kStarting, kRecording, kStopping, kFinished, kFailed };
  std::string name;
  State state{State::kStarting};
  std::string reason;       ///< Why it failed; else empty.
  std::uint64_t samples{};  ///< On disk: IMU readings, and images or the corners of images.
  std::uint64_t bytes{};    ///< On disk.
  std::uint64_t dropped{};  ///< Not recorded, because the disk was slow or failed.

  [[nodiscard]] bool is_over() const {
    return state == State::kFinished || state == State::kFailed;
  }
  /// `1200 samples, 34567 bytes saved; 0 dropped`
  [[nodiscard]] std::string counts() const {
    return std::to_string(samples) + " samples, " + std::to_string(bytes) + " bytes saved; " +
           std::to_string(dropped) + " dropped";
  }
};

/// What clients may change, whatever protocol they speak. Implemented in `app`.
///
/// Called on the threads of protocols; every call returns at once. A change of the bodies shows in
/// the next frame's `model` with a new generation. Who calls has judged the caller: by `admits`, or
/// by RemoteControl where the wire has no password.
class OperatorDesk {
 public:
  struct Body {
    int id{};
    std::string name;
    bool enabled{true};
    Pose X_BP;
  };

  virtual ~OperatorDesk() = default;

  /// Is this the operator's token? Takes the same time for every wrong one. No token configured:
  /// nobody is.
  [[nodiscard]] virtual bool admits(std::string_view token) const = 0;
  /// For protocols where the token itself does not travel, only a proof of knowing it. Never shown,
  /// never logged. Empty: none is configured, and no proof is good enough.
  [[nodiscard]] virtual std::string_view token() const { return {}; }
  /// All bodies, the disabled ones too, in the order of the configuration.
  [[nodiscard]] virtual std::vector<Body> bodies() const = 0;

  /// @return Error `kNotFound` for an id nobody has, `kInvalid` for a name that is empty, too long
  /// or taken
  virtual Expected<void> set_enabled(int body_id, bool enabled) = 0;
  virtual Expected<void> rename(int body_id, const std::string& name) = 0;
  virtual Expected<void> set_pivot(int body_id, const Pose& X_BP) = 0;

  [[nodiscard]] virtual MapMode map_mode() const = 0;
  virtual Expected<void> set_map_mode(MapMode mode) = 0;
  /// What needs the store is done a moment later, and said on the event board; so is what becomes
  /// of it. @return Error when it cannot be done: no store is configured, the map is frozen, there
  /// is no such version or tag, measured places contradict each other
  virtual Expected<void> change_map(const MapChange& change) = 0;
  /// What the store has, newest first; empty without a store.
  [[nodiscard]] virtual std::vector<MapVersionInfo> map_versions() const { return {}; }
  /// One of them. @return nullptr: it is being read, ask again in a moment
  [[nodiscard]] virtual Expected<std::shared_ptr<const TagMap>> map_version(
      std::int64_t version) const {
    return fail(ErrorCode::kNotFound, "there is no version " + std::to_string(version));
  }
  /// How well the sightings of its tags fit.
  [[nodiscard]] virtual std::vector<TagFit> tag_fits() const { return {}; }
  /// The map that is served.
  [[nodiscard]] virtual std::shared_ptr<const TagMap> map() const { return nullptr; }

  /// Raw sensors of all bodies to disk, from now on. @param name  folder name; empty: the date and
  /// time
  /// @return Error when one is under way, or the name is not a plain folder name. What the disk
  /// says shows in `recordings`
  virtual Expected<void> start_recording(const std::string& name) = 0;
  /// What was taken until now is still written: `recordings` says when that is done.
  /// @return Error when none is under way, with the reason when it had failed
  virtual Expected<void> stop_recording() = 0;
  /// Its name while one is under way.
  [[nodiscard]] virtual std::optional<std::string> recording() const = 0;
  /// Those that are not over, and a few that are; the newest last.
  [[nodiscard]] virtual std::vector<RecordingStatus> recordings() const = 0;
};

namespace words {

inline constexpr std::array<Word<RemoteControl>, 3> kRemoteControl{
    {{"off", RemoteControl::kOff},
     {"loopback", RemoteControl::kLoopback},
     {"all", RemoteControl::kAll}}};

}  // namespace words

}  // namespace fiducap
