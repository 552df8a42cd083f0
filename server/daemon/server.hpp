#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "capture/sensor_source.hpp"
#include "daemon/config/config_file.hpp"
#include "streaming/conventions/protocol_conventions.hpp"

namespace fiducap {

/// Set-up on the page, while there is no configuration.
struct SetupOptions {
  std::string file;               ///< To be written.
  bool offers_simulation{false};  ///< Also offers a simulated robot.
};

struct ServerOptions {
  bool exit_at_end{false};      ///< End when every source has ended (recordings, video files).
  bool stop_on_signals{false};  ///< End on SIGINT and SIGTERM.
  /// Motion of a simulated body instead of its configured trajectory, by name; nullptr: as
  /// configured. For robots that answer to a controller.
  std::function<std::unique_ptr<simulation::Trajectory>(const std::string& body)> motion;
  /// Replaces or wraps the source of a body that was opened as configured; nullptr: none.
  std::function<std::unique_ptr<SensorSource>(const std::string& body,
                                              std::unique_ptr<SensorSource> configured)>
      source{};
  /// Has to end the process: called when no frame was delivered for ten seconds, after the map has
  /// been stored. Empty: only reported.
  std::function<void()> give_up{};
  std::optional<SetupOptions> setup{};  ///< The configuration may have no bodies then.
};

enum class ServerEnd {
  kClean,
  kLeftBehind,  ///< A source does not release its device; everything is stored.
  kSetUp,       ///< The configuration has been written and is to be served now.
  kLost,        ///< A disk is stuck, and unwritten data is lost; that was reported.
};

/// The whole server: builds all parts, owns all threads, ends cleanly.
///
/// Threads: per body one reader and one worker; one publisher; one map keeper; one recorder; one
/// health watch; the caller of `run` serves all protocols but the pages.
class Server final {
 public:
  /// Opens the map, the sources and the ports. No thread runs before `run`.
  /// @param clock  real time; outlives the server
  /// @return Error with its remedy: a file, a port, a damaged map. A source that cannot be opened
  /// is only an error when no other one can be.
  [[nodiscard]] static Expected<std::unique_ptr<Server>> build(const ServerConfig& config,
                                                               const ServerOptions& options,
                                                               const Clock& clock);
  ~Server();

  /// Serves until stopped; returns within a second of that, or when the disks have taken the map
  /// and the recordings, or are stuck.
  /// @return other than kClean: a thread is left behind, and the process has to end without
  /// destroying this server
  [[nodiscard]] ServerEnd run();
  /// From any thread.
  void stop();
  [[nodiscard]] ProtocolPorts ports() const;
  /// t = 0 of the motion of simulated bodies.
  [[nodiscard]] Instant simulation_start() const;

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
