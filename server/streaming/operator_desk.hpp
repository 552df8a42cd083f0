#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"
#include "base/pose.hpp"
#include "mapping/map_builder.hpp"

namespace fiducap {

/// Who may change the server's state over a protocol that knows no password.
enum class RemoteControl { kOff, kLoopback, kAll };

/// What clients may change, whatever protocol they speak. Implemented in `app`.
///
/// Called on the I/O thread; every call returns at once. A change of the bodies shows in the next
/// frame's `model` with a new generation. Who calls has judged the caller: by `admits`, or by
/// RemoteControl where the wire has no password.
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
  /// Writes the map as it is now as a version. @return Error when no store is configured
  virtual Expected<void> commit_map() = 0;

  /// Raw sensors of all bodies to disk. @param name  folder name; empty: the date and time
  /// @return Error when one is under way, the name is not a plain folder name, or it exists
  virtual Expected<void> start_recording(const std::string& name) = 0;
  virtual Expected<void> stop_recording() = 0;
  /// Its name while one is under way.
  [[nodiscard]] virtual std::optional<std::string> recording() const = 0;
};

namespace words {

inline constexpr std::array<Word<RemoteControl>, 3> kRemoteControl{
    {{"off", RemoteControl::kOff},
     {"loopback", RemoteControl::kLoopback},
     {"all", RemoteControl::kAll}}};

}  // namespace words

}  // namespace fiducap
