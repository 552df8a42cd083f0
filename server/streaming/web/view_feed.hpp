#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "streaming/net/places.hpp"
#include "streaming/web/view_connection.hpp"
#include "streaming/web/web_config.hpp"

namespace fiducap::web {

/// Who watches cameras, and what is made for them: a camera is asked for pictures while somebody
/// wishes them, as large and as often as the largest wish. No socket, no thread; time comes in.
class ViewFeed final {
 public:
  static constexpr std::size_t kMostViewers = 8;
  static constexpr std::size_t kMostPerAddress = 4;

  /// @param views  nullptr: there are no pictures
  ViewFeed(ViewRule rule, CameraViews* views) : rule_(rule), views_(views) {}

  /// @param speaks_for_another  it says that it passes on what another one asks (a proxy)
  /// @param has_token  an operator's token is configured
  [[nodiscard]] ViewAccess access(const net::Peer& peer, bool speaks_for_another,
                                  bool has_token) const;
  /// Is there a place for one more who may look? One that has proven nothing holds none.
  [[nodiscard]] bool has_room(const net::Peer& peer) const { return place_for(peer).is_there; }
  /// @param proof  asks for the token, see `admit`; nullptr: he may look without, and takes a
  /// place   @pre has_room(peer), where there is no proof
  [[nodiscard]] std::shared_ptr<ViewConnection> join(
      const net::Peer& peer, Instant now, std::unique_ptr<native::ControlConversation> proof);
  /// Takes a place for who has just proven that he may look. @return false: there is none
  [[nodiscard]] bool admit(ViewConnection& connection);
  void leave(const ViewConnection& connection);
  void wish(ViewConnection& connection, std::span<const NamedWish> wishes);
  /// Takes new pictures and leaves them with those who wish them.
  void tick(Instant now);

  [[nodiscard]] std::span<const CameraViews::Camera> cameras() const;
  [[nodiscard]] const std::vector<std::shared_ptr<ViewConnection>>& connections() const {
    return connections_;
  }

 private:
  [[nodiscard]] net::Place place_for(const net::Peer& peer) const;
  void take(const net::Place& place);
  void ask_for_pictures();

  ViewRule rule_;
  CameraViews* views_;
  std::vector<std::shared_ptr<ViewConnection>> connections_;
  std::vector<std::optional<ViewWish>> asked_;  ///< Per camera.
};

}  // namespace fiducap::web
