#pragma once

#include <optional>
#include <string_view>

#include "streaming/natnet/answer.hpp"
#include "streaming/natnet/operator_words.hpp"
#include "streaming/natnet/registry.hpp"

namespace fiducap::natnet {

/// Every word of a REQUEST that clients are known to send, and its answer. Any other:
/// UNRECOGNIZED_REQUEST.
///
/// Answers: a number in 4 bytes; 0 for done, anything else for refused; or text. Timeline words of
/// a player are accepted and do nothing, for clients send them along with others.
class CommandWords final {
 public:
  struct Asker {
    Peer peer;
    bool multicast{};
    Bitstream version;         ///< What it is sent now.
    Subscriber* subscriber{};  ///< nullptr: gets no unicast frames. Its selection may change here.
  };
  struct Answer {
    Datagram datagram;
    std::optional<Bitstream> switch_to{};  ///< From now on send it this version.
    bool leaves{};
  };

  [[nodiscard]] Answer answer(std::string_view text, const ServerView& server, const Asker& asker);
  /// One that an old vendor library cannot do without, and we cannot answer (reference, 4.4).
  [[nodiscard]] static bool is_legacy_check(std::string_view text) {
    return text.starts_with("service20,");
  }

 private:
  OperatorWords operator_words_;
};

}  // namespace fiducap::natnet
