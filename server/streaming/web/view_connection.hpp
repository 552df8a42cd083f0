#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/camera_views.hpp"
#include "streaming/native/control_conversation.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/streamer.hpp"
#include "streaming/web/live_connection.hpp"
#include "streaming/web/view_codec.hpp"

namespace fiducap::web {

/// One viewer's conversation, without its socket: who has to prove first that he knows the
/// operator's token, says then what he wants to see, and gets pictures. One waits per camera, the
/// newest wins; a camera gives no more than was wished, all together kMostPerSecond.
class ViewConnection final {
 public:
  static constexpr double kMostPerSecond = 30;

  /// @param cameras  how many there are
  /// @param proof  asks for the token; nullptr: he may look without
  ViewConnection(const net::Peer& peer, Instant connected_at, std::size_t cameras,
                 std::unique_ptr<native::ControlConversation> proof);
  [[nodiscard]] const net::Peer& peer() const { return peer_; }
  [[nodiscard]] bool is_admitted() const { return proof_ == nullptr || proof_->is_operator(); }
  /// One of the bounded number, see ViewFeed.
  void give_place() { place_ = PlaceState::kHeld; }
  [[nodiscard]] bool has_place() const { return place_ == PlaceState::kHeld; }
  /// Another one gets its place: it is closed with the next look.
  void dismiss() { place_ = PlaceState::kTaken; }
  [[nodiscard]] bool dismissed() const { return place_ == PlaceState::kTaken; }
  /// @return false: he said nothing for too long before he was admitted
  [[nodiscard]] bool is_patient(Instant now) const { return is_admitted() || proof_->patient(now); }

  /// What he is asked at the start; nothing for who may look.
  void greet(std::vector<std::byte>& out, Instant now);
  /// A binary message: of the control channel, until he is admitted. @return false: say what is in
  /// `out`, then hang up
  [[nodiscard]] bool prove(std::span<const std::byte> bytes, std::vector<std::byte>& out,
                           Instant now);
  /// Instead of what he wished before. A camera that does not exist gives nothing.
  /// @pre is_admitted()
  void wish(std::span<const NamedWish> wishes, std::span<const CameraViews::Camera> cameras);
  [[nodiscard]] const std::optional<ViewWish>& wish_of(std::size_t camera) const {
    return places_[camera].wish;
  }

  void offer(std::size_t camera, const CameraViews::Picture& picture, Instant now);
  /// The next picture to send; nullptr: there is none, or one is still under way.
  [[nodiscard]] Message next(Instant now);
  /// The picture given by `next` has left.
  void written() { writing_since_.reset(); }
  /// A write is under way for longer than `patience`: the other side has stopped reading.
  [[nodiscard]] bool is_stuck(Instant now, Duration patience) const {
    return writing_since_ && now - *writing_since_ > patience;
  }
  [[nodiscard]] ClientStatus status(Instant now) const;

 private:
  struct Place {
    std::optional<ViewWish> wish;
    CameraViews::Picture waiting;
    std::optional<Instant> due_at;  ///< Of the next picture.
  };
  enum class PlaceState { kNone, kHeld, kTaken };
  [[nodiscard]] static bool is_due(Place& place, Instant now);

  net::Peer peer_;
  Instant connected_at_;
  std::unique_ptr<native::ControlConversation> proof_;
  std::vector<Place> places_;  ///< One per camera.
  PlaceState place_{PlaceState::kNone};
  std::size_t turn_{0};  ///< Which camera comes next.
  net::TokenBucket sent_lately_;
  std::optional<Instant> writing_since_;
  std::uint64_t sent_{0};
  std::uint64_t dropped_{0};
};

}  // namespace fiducap::web
