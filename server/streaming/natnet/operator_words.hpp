#pragma once

#include <optional>
#include <string>

#include "streaming/natnet/answer.hpp"
#include "streaming/natnet/request.hpp"
#include "streaming/natnet/server_view.hpp"

namespace fiducap::natnet {

/// Commands about recordings, bodies and properties. What has a meaning here is done by the
/// OperatorDesk; the answer is 0 only when it was.
class OperatorWords final {
 public:
  /// @return nullopt: not one of these words
  [[nodiscard]] std::optional<Datagram> answer(const Command& command, const ServerView& server,
                                               const Peer& from);

 private:
  using Handler = Expected<void> (OperatorWords::*)(const Command&, const ServerView&);
  struct Word;
  static const Word kWords[];

  Expected<void> start_recording(const Command& command, const ServerView& server);
  Expected<void> stop_recording(const Command& command, const ServerView& server);
  Expected<void> set_take_name(const Command& command, const ServerView& server);
  Expected<void> enable(const Command& command, const ServerView& server);
  Expected<void> disable(const Command& command, const ServerView& server);
  Expected<void> reset_orientation(const Command& command, const ServerView& server);
  Expected<void> reset_location(const Command& command, const ServerView& server);
  Expected<void> set_property(const Command& command, const ServerView& server);
  Expected<void> unsupported(const Command& command, const ServerView& server);

  std::string next_take_;  ///< Name of the next recording; empty: date and time.
};

}  // namespace fiducap::natnet
