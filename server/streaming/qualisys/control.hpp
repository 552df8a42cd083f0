#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "streaming/operator_api.hpp"
#include "streaming/qualisys/codec.hpp"
#include "streaming/qualisys/frame_board.hpp"

namespace fiducap::qualisys {

/// A command packet when ok, else an error packet.
struct Reply {
  bool ok{false};
  std::string text;
  bool wrong_password{false};

  [[nodiscard]] static Reply done(std::string text) { return {true, std::move(text), false}; }
  [[nodiscard]] static Reply refused(std::string text) { return {false, std::move(text), false}; }
};

/// The master client and its commands. One for all connections.
///
/// The password of TakeControl is the operator's token. A capture is a recording of the raw
/// sensors; its name is fixed when it starts, Save only reports it. Poses stream also without a
/// capture. All texts are QTM's, because clients compare them.
class Control final {
 public:
  using ClientId = std::uint64_t;

  /// @param operator_api  outlives this; nullptr: no client can take control
  explicit Control(OperatorApi* operator_api) : operator_api_(operator_api) {}

  /// @param peer  shown to other clients that try
  [[nodiscard]] Reply take(ClientId client, std::string_view peer, std::string_view password);
  [[nodiscard]] Reply release(ClientId client);
  /// The connection ended: control is free.
  void left(ClientId client);
  /// A change of the token ends its control.
  [[nodiscard]] bool is_master(ClientId client) const {
    return master_ == client && proven_at_ == operator_api_->tokens_changed();
  }

  /// New, Close, Start, Stop, Save, Load, LoadProject, Trig, Event, Reprocess, Calibrate, …
  /// @return nullopt: not one of them
  [[nodiscard]] std::optional<Reply> execute(ClientId client, const Command& command);
  /// A settings packet of a master: `Enabled` of bodies, by name; ignores the rest.
  [[nodiscard]] Reply apply_settings(ClientId client, std::string_view xml,
                                     std::span<const BodyTable::Entry> bodies);

  /// For GetState.
  [[nodiscard]] Event state() const;
  /// Appends the events since the last call, also those of other protocols and the page.
  void observe(std::vector<Event>& out);

 private:
  [[nodiscard]] bool recording() const {
    return operator_api_ != nullptr && operator_api_->recording().has_value();
  }
  Reply start(std::string_view argument);
  Reply stop();
  Reply save() const;
  Reply close();
  [[nodiscard]] Requester master() const { return {kName, kOperatorRight, master_peer_}; }

  static constexpr std::string_view kName = "qualisys";

  OperatorApi* operator_api_;
  std::optional<ClientId> master_;
  std::string master_peer_;
  std::uint64_t proven_at_{0};          ///< tokens_changed() then.
  std::optional<std::string> running_;  ///< Recording at the last `observe`.
  std::optional<std::string> ending_;   ///< Stopped, not yet saved or failed.
  std::string last_capture_;            ///< Name; empty: none, or it was closed.
};

}  // namespace fiducap::qualisys
