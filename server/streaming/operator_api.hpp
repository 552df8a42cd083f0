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
#include "base/text.hpp"
#include "mapping/map_builder.hpp"
#include "mapping/map_edit.hpp"
#include "mapping/store/map_rows.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

/// Which clients may change the server's state over a protocol without passwords.
enum class RemoteControl { kOff, kLoopback, kAll };

/// The client that wants a change, for the audit log.
struct Requester {
  std::string_view protocol{};  ///< `native`, `web`, …; a literal, as the next one.
  std::string_view right{};     ///< Why it may: `operator token`, …; empty: it has none.
  std::string address{};        ///< `10.0.0.7:1511`
};

/// Right of clients that have proven the operator's token.
inline constexpr std::string_view kOperatorRight = "operator token";

/// A running or finished recording.
struct RecordingStatus {
  enum class State { kStarting, kRecording, kStopping, kFinished, kFailed };
  std::string name;
  State state{State::kStarting};
  std::string reason;       ///< Why it failed; else empty.
  std::uint64_t samples{};  ///< On disk: IMU readings, and images or the corners of images.
  std::uint64_t bytes{};    ///< On disk.
  std::uint64_t dropped{};  ///< Not recorded: the disk was slow or failed.

  [[nodiscard]] bool is_over() const {
    return state == State::kFinished || state == State::kFailed;
  }
  /// `1200 samples, 34567 bytes saved; 0 dropped`
  [[nodiscard]] std::string counts() const {
    return std::to_string(samples) + " samples, " + std::to_string(bytes) + " bytes saved; " +
           std::to_string(dropped) + " dropped";
  }
};

/// The changes that clients of all protocols may request. Implemented in `daemon`.
///
/// Called on the threads of protocols; every call returns at once. Each change is audited. A change
/// of the bodies shows in the next frame's `model` with a new generation. The protocol authorises
/// the client: by `admits`, or by RemoteControl when the wire has no password.
class OperatorApi {
 public:
  struct Body {
    int id{};
    std::string name;
    bool enabled{true};
    Pose X_BP;
  };

  virtual ~OperatorApi() = default;

  /// The operator's token. Never shown or logged. Empty: no proof is valid.
  [[nodiscard]] virtual std::string token() const { return {}; }
  /// The token for reading pages. Empty: reading needs none.
  [[nodiscard]] virtual std::string read_token() const { return {}; }
  /// Counts changes of the tokens: earlier proofs are void.
  [[nodiscard]] virtual std::uint64_t tokens_changed() const { return 0; }
  /// @return it is the operator's token (never when none is configured); takes constant time
  [[nodiscard]] bool admits(std::string_view given) const { return same_secret(given, token()); }
  /// For the audit log: a wrong proof, or a change without the right to it.
  virtual void note_refusal(const Requester& /*by*/, const std::string& /*what*/,
                            const std::string& /*why*/) {}
  /// All bodies, also disabled ones, in the order of the configuration.
  [[nodiscard]] virtual std::vector<Body> bodies() const = 0;

  /// @return Error `kNotFound` for an unknown id, `kInvalid` for an empty, too long or taken name
  virtual Expected<void> set_enabled(const Requester& by, int body_id, bool enabled) = 0;
  virtual Expected<void> rename(const Requester& by, int body_id, const std::string& name) = 0;
  virtual Expected<void> set_pivot(const Requester& by, int body_id, const Pose& X_BP) = 0;

  [[nodiscard]] virtual MapMode map_mode() const = 0;
  virtual Expected<void> set_map_mode(const Requester& by, MapMode mode) = 0;
  /// Changes of the store happen later; their result is an event. @return Error when no store is
  /// configured, the map is frozen, a version or tag is unknown, or places contradict each other
  virtual Expected<void> change_map(const Requester& by, const MapChange& change) = 0;
  /// Versions in the store, newest first; empty without a store.
  [[nodiscard]] virtual std::vector<MapVersionInfo> map_versions() const { return {}; }
  /// @return nullptr: it is being read, ask again
  [[nodiscard]] virtual Expected<std::shared_ptr<const TagMap>> map_version(
      std::int64_t version) const {
    return fail(ErrorCode::kNotFound, "there is no version " + std::to_string(version));
  }
  /// Residuals of the map's tags.
  [[nodiscard]] virtual std::vector<TagFit> tag_fits() const { return {}; }
  /// The published map.
  [[nodiscard]] virtual std::shared_ptr<const TagMap> map() const { return nullptr; }

  /// Records the raw sensors of all bodies. @param name  folder name; empty: date and time
  /// @return Error when one is running or the name is invalid; errors of the disk: `recordings`
  virtual Expected<void> start_recording(const Requester& by, const std::string& name) = 0;
  /// The rest is still written: see `recordings`.
  /// @return Error when none is running, with the reason when it had failed
  virtual Expected<void> stop_recording(const Requester& by) = 0;
  /// Name of the running recording.
  [[nodiscard]] virtual std::optional<std::string> recording() const = 0;
  /// All unfinished ones and a few finished ones; the newest last.
  [[nodiscard]] virtual std::vector<RecordingStatus> recordings() const = 0;
};

namespace words {

inline constexpr std::array<Word<RemoteControl>, 3> kRemoteControl{
    {{"off", RemoteControl::kOff},
     {"loopback", RemoteControl::kLoopback},
     {"all", RemoteControl::kAll}}};

}  // namespace words

}  // namespace fiducap
