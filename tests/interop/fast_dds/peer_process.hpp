#pragma once

#include <sys/types.h>

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "streaming/streamer.hpp"

namespace fiducap::dds {

/// What the other vendor's subscriber printed about one topic.
struct Heard {
  int count{};         ///< Messages.
  int ids{};           ///< Different keys.
  int incompatible{};  ///< QoS policy that did not fit; 0: none.
  std::string last;    ///< The newest message.
};

/// `fast_dds_peer` as a child process. Its output is read when it ends.
class PeerProcess final {
 public:
  /// @param before_exec  in the child
  explicit PeerProcess(const std::vector<std::string>& arguments,
                       const std::function<void()>& before_exec = {});
  ~PeerProcess();
  PeerProcess(const PeerProcess&) = delete;
  PeerProcess& operator=(const PeerProcess&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] bool is_running();
  /// Waits for its end. By topic, as on the wire.
  [[nodiscard]] std::map<std::string, Heard> heard();

 private:
  pid_t pid_{-1};
  int output_{-1};
};

/// Frames at 100 Hz until `go_on` says no; the bodies move, so that a repeated message would show.
void publish_frames(Streamer& server, const std::vector<std::string>& bodies,
                    const std::function<bool()>& go_on);

}  // namespace fiducap::dds
