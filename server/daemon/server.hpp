#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "daemon/config/config_file.hpp"
#include "daemon/protocol_servers.hpp"

namespace fiducap {

/// There is no configuration yet: it is made on the page.
struct SetupOptions {
  std::string file;               ///< That is to be written.
  bool offers_simulation{false};  ///< A simulated robot stands beside this machine's cameras.
};

struct ServerOptions {
  bool exit_at_end{false};      ///< End when every source has ended (recordings, video files).
  bool stop_on_signals{false};  ///< End on SIGINT and SIGTERM.
  /// How a simulated body moves instead of its configured trajectory, by name; nullptr: as
  /// configured. For robots that answer to a controller.
  std::function<std::unique_ptr<simulation::Trajectory>(const std::string& body)> motion;
  /// Stands in for, or around, the source of a body that was opened as configured; nullptr: none.
  std::function<std::unique_ptr<SensorSource>(const std::string& body,
                                              std::unique_ptr<SensorSource> configured)>
      source{};
  /// When frames have reached nobody for ten seconds, whatever the reason, and the map is stored:
  /// has to end the process. Empty: it is only said.
  std::function<void()> give_up{};
  std::optional<SetupOptions> setup{};  ///< The configuration may have no bodies then.
};

enum class ServerEnd {
  kClean,
  kLeftBehind,  ///< A source does not let go of its device; everything is stored.
  kSetUp,       ///< The configuration has been made: it is to be served now.
  kLost,        ///< So does a disk, with what waited for it; that was said.
};

/// The whole machine: builds the rooms from left to right, owns all threads, ends cleanly.
///
/// Threads: per body one reader and one worker; one publisher; one map keeper; one recorder; one
/// that watches over all of it; the caller of `run` does all I/O.
class Server final {
 public:
  /// Opens the map, the sources and the ports. Nothing moves before `run`.
  /// @param clock  real time; outlives the server
  /// @return Error with what to do about it: a file, a port, a damaged map. A source that cannot be
  /// opened is only
  ///         an error when no other one can be.
  [[nodiscard]] static Expected<std::unique_ptr<Server>> build(const ServerConfig& config,
                                                               const ServerOptions& options,
                                                               const Clock& clock);
  ~Server();

  /// Serves until stopped; returns within a second of that, or when the disks have taken the map
  /// and what was recorded, or are stuck.
  /// @return other than kClean: a thread is left behind, and the only way to get rid of it is to
  /// end the process without destroying this server
  [[nodiscard]] ServerEnd run();
  /// From any thread.
  void stop();
  [[nodiscard]] ServerPorts ports() const;
  /// When the motion of simulated bodies begins: their t = 0.
  [[nodiscard]] Instant simulation_start() const;

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
