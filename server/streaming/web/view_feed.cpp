#include "streaming/web/view_feed.hpp"

#include <algorithm>
#include <utility>
#include "streaming/conventions/frame_sequence.hpp"

namespace fiducap::web {

namespace {

constexpr double kEarly = 0.05;  // of the period: tolerance for the images' own rate

ViewAccess denied(std::string why) { return {ViewAccess::Kind::kDenied, std::move(why)}; }

/// One picture for both requests.
ViewRequest united(const std::optional<ViewRequest>& a, const ViewRequest& b) {
  if (!a) return b;
  return {std::max(a->width_px, b.width_px), std::max(a->per_second, b.per_second),
          a->candidates || b.candidates};
}

}  // namespace

ViewConnection::ViewConnection(const net::Peer& peer, Instant connected_at, std::size_t cameras,
                               std::unique_ptr<native::ControlConversation> proof)
    : FeedClient(peer, connected_at), proof_(std::move(proof)), places_(cameras) {}

void ViewConnection::greet(std::vector<std::byte>& out, Instant now) {
  if (proof_) proof_->greet(out, now);
}

bool ViewConnection::prove(std::span<const std::byte> bytes, std::vector<std::byte>& out,
                           Instant now) {
  return !is_admitted() && proof_->receive(bytes, out, now);
}

void ViewConnection::request(std::span<const CameraRequest> requests,
                             std::span<const CameraViews::Camera> cameras) {
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const auto wanted = std::ranges::find_if(requests, [&](const CameraRequest& one) {
      return one.body_id == cameras[i].body_id && one.camera == cameras[i].camera;
    });
    Place& place = places_[i];
    if (wanted == requests.end()) {
      place = {};
    } else if (place.request != wanted->request) {
      place.request = wanted->request;
      place.due_at.reset();
    }
  }
}

void ViewConnection::offer(std::size_t camera, const CameraViews::Picture& picture, Instant now) {
  Place& place = places_[camera];
  if (!place.request) return;
  const Duration period = from_seconds(1.0 / place.request->per_second);
  const Duration early = from_seconds(kEarly / place.request->per_second);
  if (!is_period_due(place.due_at, now, period, early)) return;
  if (place.waiting) ++dropped_;
  place.waiting = picture;
}

Message ViewConnection::next(Instant now) {
  if (writing_since_) return nullptr;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    Place& place = places_[(next_camera_ + i) % places_.size()];
    if (!place.waiting) continue;
    if (!sent_bucket_.take(1, kMostPerSecond, kMostPerSecond, now)) return nullptr;
    next_camera_ = (next_camera_ + i + 1) % places_.size();
    writing_since_ = now;
    ++sent_;
    return std::exchange(place.waiting, nullptr);
  }
  return nullptr;
}

ClientStatus ViewConnection::status(Instant now) const {
  const auto watched =
      std::ranges::count_if(places_, [](const Place& place) { return place.request.has_value(); });
  return FeedClient::status(
      "camera views, " + std::to_string(watched) + (watched == 1 ? " camera" : " cameras"), now);
}

ViewAccess ViewFeed::access(const net::Peer& peer, bool is_forwarded, bool has_token) const {
  if (views_ == nullptr) return denied("this server has no cameras to show");
  const bool is_here = peer.is_loopback() && !is_forwarded;
  switch (rule_) {
    case ViewRule::kOff:
      return denied("camera views are disabled: streaming.web.camera_views is `off`");
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
  const auto same =
      std::ranges::count_if(holders, [&](const net::Peer& one) { return one.same_address(peer); });
  if (static_cast<std::size_t>(same) >= kMostPerAddress) return {};
  return net::place_for(peer, holders, kMostViewers);
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
  // From the newest viewer of the address that loses one.
  const auto newest =
      std::find_if(connections_.rbegin(), connections_.rend(), [&](const auto& one) {
        return place.instead_of && one->has_place() && one->peer().same_address(*place.instead_of);
      });
  if (newest != connections_.rend()) (*newest)->dismiss();
  connection.give_place();
  return true;
}

void ViewFeed::leave(const ViewConnection& connection) {
  std::erase_if(connections_, [&](const auto& held) { return held.get() == &connection; });
  ask_for_pictures();
}

void ViewFeed::request(ViewConnection& connection, std::span<const CameraRequest> requests) {
  connection.request(requests, cameras());
  ask_for_pictures();
}

void ViewFeed::ask_for_pictures() {
  asked_.resize(cameras().size());
  for (std::size_t i = 0; i < asked_.size(); ++i) {
    std::optional<ViewRequest> wanted;
    for (const auto& one : connections_)
      if (const auto& request = one->request_of(i)) wanted = united(wanted, *request);
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
