#include "streaming/web/view_feed.hpp"

#include <algorithm>
#include <utility>

namespace fiducap::web {

namespace {

ViewAccess denied(std::string why) { return {ViewAccess::Kind::kDenied, std::move(why)}; }

/// One picture for both.
ViewWish united(const std::optional<ViewWish>& a, const ViewWish& b) {
  if (!a) return b;
  return {std::max(a->width_px, b.width_px), std::max(a->per_second, b.per_second),
          a->candidates || b.candidates};
}

}  // namespace

ViewAccess ViewFeed::access(const net::Peer& peer, bool speaks_for_another, bool has_token) const {
  if (views_ == nullptr) return denied("this server has no cameras to show");
  const bool is_here = peer.is_loopback() && !speaks_for_another;
  switch (rule_) {
    case ViewRule::kOff:
      return denied("camera views are switched off: streaming.web.camera_views is `off`");
    case ViewRule::kEveryone:
      return {};
    case ViewRule::kLoopback:
      if (is_here) return {};
      return denied(
          "camera views are for the server's own machine: open the page there or through a tunnel "
          "(ssh -L), or set streaming.web.camera_views to `operator` or `everyone`");
    case ViewRule::kOperator:
      break;
  }
  if (is_here) return {};
  if (has_token) return {ViewAccess::Kind::kProof, "camera views need the operator's token"};
  return denied(
      "camera views are for the server's own machine and for operators, and no operator's token is "
      "configured: set operator.token_file, or open the page through a tunnel (ssh -L)");
}

net::Place ViewFeed::place_for(const net::Peer& peer) const {
  std::vector<net::Peer> holders;
  for (const auto& one : connections_)
    if (one->has_place()) holders.push_back(one->peer());
  const auto same = std::count_if(holders.begin(), holders.end(),
                                  [&](const net::Peer& one) { return one.same_address(peer); });
  if (static_cast<std::size_t>(same) >= kMostPerAddress) return {};
  return net::place_for(peer, holders, kMostViewers);
}

/// From the newest of the address that gives one up.
void ViewFeed::take(const net::Place& place) {
  if (!place.instead_of) return;
  const auto newest =
      std::find_if(connections_.rbegin(), connections_.rend(), [&](const auto& one) {
        return one->has_place() && one->peer().same_address(*place.instead_of);
      });
  if (newest != connections_.rend()) (*newest)->dismiss();
}

std::shared_ptr<ViewConnection> ViewFeed::join(const net::Peer& peer, Instant now,
                                               std::unique_ptr<native::ControlConversation> proof) {
  auto made = std::make_shared<ViewConnection>(peer, now, cameras().size(), std::move(proof));
  if (made->is_admitted()) (void)admit(*made);
  connections_.push_back(made);
  return made;
}

bool ViewFeed::admit(ViewConnection& connection) {
  const net::Place place = place_for(connection.peer());
  if (!place.is_there) return false;
  take(place);
  connection.give_place();
  return true;
}

void ViewFeed::leave(const ViewConnection& connection) {
  std::erase_if(connections_, [&](const auto& held) { return held.get() == &connection; });
  ask_for_pictures();
}

void ViewFeed::wish(ViewConnection& connection, std::span<const NamedWish> wishes) {
  connection.wish(wishes, cameras());
  ask_for_pictures();
}

void ViewFeed::ask_for_pictures() {
  asked_.resize(cameras().size());
  for (std::size_t i = 0; i < asked_.size(); ++i) {
    std::optional<ViewWish> wanted;
    for (const auto& one : connections_)
      if (const auto& wish = one->wish_of(i)) wanted = united(wanted, *wish);
    if (wanted == asked_[i]) continue;
    asked_[i] = wanted;
    views_->watch(i, wanted);
  }
}

void ViewFeed::tick(Instant now) {
  for (std::size_t i = 0; i < asked_.size(); ++i) {
    if (!asked_[i]) continue;
    const CameraViews::Picture picture = views_->take(i);
    if (!picture) continue;
    for (const auto& one : connections_) one->offer(i, picture, now);
  }
}

std::span<const CameraViews::Camera> ViewFeed::cameras() const {
  if (views_ == nullptr) return {};
  return views_->cameras();
}

}  // namespace fiducap::web
