#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "streaming/operator_desk.hpp"
#include "streaming/qualisys/body_table.hpp"
#include "streaming/qualisys/command.hpp"

namespace fiducap::qualisys {

/// What is said back: a command packet when it went well, else an error packet.
struct Reply {
  bool ok{false};
  std::string text;
  bool wrong_password{false};
};

/// Who is master, and what a master may do. One for all connections.
///
/// TakeControl wants the operator's token as password. A capture is a recording of the raw sensors;
/// it has its name from the moment it starts, so Save only tells that name. Poses stream whether or
/// not a capture runs. All texts are QTM's, because clients compare them.
class Control final {
 public:
  using ClientId = std::uint64_t;

  /// @param desk  outlives this; null: nobody can take control
  explicit Control(OperatorDesk* desk) : desk_(desk) {}

  /// @param peer  told to others who try
  [[nodiscard]] Reply take(ClientId client, std::string_view peer, std::string_view password);
  [[nodiscard]] Reply release(ClientId client);
  /// Its connection ended: control is free again.
  void left(ClientId client);
  [[nodiscard]] bool is_master(ClientId client) const { return master_ == client; }

  /// New, Close, Start, Stop, Save, Load, LoadProject, Trig, Event, Reprocess, Calibrate, …
  /// @return nothing when the word is none of them
  [[nodiscard]] std::optional<Reply> execute(ClientId client, const Command& command);
  /// A settings packet of a master: `Enabled` of bodies, by name. The rest of it is not ours to
  /// set.
  [[nodiscard]] Reply apply_settings(ClientId client, std::string_view xml,
                                     std::span<const BodyTable::Entry> bodies);

  /// What GetState answers.
  [[nodiscard]] Event state() const;
  /// What happened since the last call, whoever did it (another protocol, the page), for all
  /// clients.
  void observe(std::vector<Event>& out);

 private:
  [[nodiscard]] bool recording() const {
    return desk_ != nullptr && desk_->recording().has_value();
  }
  Reply start(std::string_view argument);
  Reply stop();
  Reply save() const;
  Reply close();

  OperatorDesk* desk_;
  std::optional<ClientId> master_;
  std::string master_peer_;
  std::optional<std::string> running_;  ///< Recording when it was looked at last …
  std::optional<std::string> ending_;  ///< … and this one, until it is on the disk or has failed.
  std::string
      last_capture_;  ///< Name of the one that ended; empty: there is none, or it was closed.
};

}  // namespace fiducap::qualisys
