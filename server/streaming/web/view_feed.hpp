#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/native/control_session.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/page_api.hpp"
#include "streaming/streamer.hpp"
#include "streaming/web/live_feed.hpp"
#include "streaming/web/view_codec.hpp"
#include "streaming/web/web.hpp"

namespace fiducap::web {

/// One viewer, without its socket: proves a token if required, requests cameras, and
/// gets pictures: the newest per camera, at the requested rate, at most kMostPerSecond in total.
class ViewConnection final : public FeedClient {
 public:
  static constexpr double kMostPerSecond = 30;

  /// @param cameras  their number
  /// @param proof  asks for the token; nullptr: not required
  ViewConnection(const net::Peer& peer, Instant connected_at, std::size_t cameras,
                 std::unique_ptr<native::ControlConversation> proof);
  [[nodiscard]] bool is_admitted() const { return proof_ == nullptr || proof_->is_admitted(); }
  /// One of a bounded number, see ViewFeed.
  void give_place() { has_place_ = true; }
  [[nodiscard]] bool has_place() const { return has_place_ && !dismissed(); }
  /// @return false: no proof within the time limit, or of a token that has been replaced
  [[nodiscard]] bool is_alive(Instant now) const {
    return is_admitted() || (!has_place_ && proof_->is_alive(now));
  }

  /// The request for a proof, if required.
  void greet(std::vector<std::byte>& out, Instant now);
  /// A message of the control channel, for the proof. @return false: send `out`, then disconnect
  [[nodiscard]] bool prove(std::span<const std::byte> bytes, std::vector<std::byte>& out,
                           Instant now);
  /// Replaces earlier requests; ignores unknown cameras.
  /// @pre is_admitted()
  void request(std::span<const CameraRequest> requests,
               std::span<const CameraViews::Camera> cameras);
  [[nodiscard]] const std::optional<ViewRequest>& request_of(std::size_t camera) const {
    return places_[camera].request;
  }

  void offer(std::size_t camera, const CameraViews::Picture& picture, Instant now);
  /// The next picture to send; nullptr: none, or a write is pending.
  [[nodiscard]] Message next(Instant now);
  [[nodiscard]] ClientStatus status(Instant now) const;

 private:
  struct Place {
    std::optional<ViewRequest> request;
    CameraViews::Picture waiting;
    std::optional<Instant> due_at;  ///< Of the next picture.
  };

  std::unique_ptr<native::ControlConversation> proof_;
  std::vector<Place> places_;  ///< One per camera.
  bool has_place_{false};
  std::size_t next_camera_{0};
  net::TokenBucket sent_bucket_;
};

/// All viewers. A camera makes pictures while they are requested, at the largest requested size and
/// rate. No socket, no thread; time is passed in.
class ViewFeed final {
 public:
  static constexpr std::size_t kMostViewers = 8;
  static constexpr std::size_t kMostPerAddress = 4;

  /// @param views  nullptr: no pictures
  ViewFeed(ViewRule rule, CameraViews* views) : rule_(rule), views_(views) {}

  /// @param is_forwarded  the request came through a proxy
  /// @param has_token  an operator's token is configured
  [[nodiscard]] ViewAccess access(const net::Peer& peer, bool is_forwarded, bool has_token) const;
  /// @return there is a place for one more viewer; unproven ones have none
  [[nodiscard]] bool has_place(const net::Peer& peer) const { return place_for(peer).is_there; }
  /// @param proof  asks for the token, see `admit`; nullptr: not required, takes a place
  /// @pre has_place(peer) without a proof
  [[nodiscard]] std::shared_ptr<ViewConnection> join(
      const net::Peer& peer, Instant now, std::unique_ptr<native::ControlConversation> proof);
  /// Takes a place after the proof. @return false: none
  [[nodiscard]] bool admit(ViewConnection& connection);
  void leave(const ViewConnection& connection);
  void request(ViewConnection& connection, std::span<const CameraRequest> requests);
  /// Takes new pictures and offers them to the viewers.
  void tick(Instant now);

  [[nodiscard]] std::span<const CameraViews::Camera> cameras() const;
  [[nodiscard]] const std::vector<std::shared_ptr<ViewConnection>>& connections() const {
    return connections_;
  }

 private:
  [[nodiscard]] net::Place place_for(const net::Peer& peer) const;
  void ask_for_pictures();

  ViewRule rule_;
  CameraViews* views_;
  std::vector<std::shared_ptr<ViewConnection>> connections_;
  std::vector<std::optional<ViewRequest>> asked_;  ///< Per camera.
};

}  // namespace fiducap::web
