#include "streaming/web/view_connection.hpp"

#include <algorithm>
#include <utility>

namespace fiducap::web {

namespace {

// As early as this is in time: pictures come by the images' own beat.
constexpr double kEarly = 0.05;  // of the period

}  // namespace

ViewConnection::ViewConnection(const net::Peer& peer, Instant connected_at, std::size_t cameras,
                               std::unique_ptr<native::ControlConversation> proof)
    : peer_(peer), connected_at_(connected_at), proof_(std::move(proof)), places_(cameras) {}

void ViewConnection::greet(std::vector<std::byte>& out, Instant now) {
  if (proof_) proof_->greet(out, now);
}

bool ViewConnection::prove(std::span<const std::byte> bytes, std::vector<std::byte>& out,
                           Instant now) {
  return !is_admitted() && proof_->receive(bytes, out, now);
}

void ViewConnection::wish(std::span<const NamedWish> wishes,
                          std::span<const CameraViews::Camera> cameras) {
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const auto wanted = std::find_if(wishes.begin(), wishes.end(), [&](const NamedWish& one) {
      return one.body_id == cameras[i].body_id && one.camera == cameras[i].camera;
    });
    Place& place = places_[i];
    if (wanted == wishes.end()) {
      place = {};
    } else if (place.wish != wanted->wish) {
      place.wish = wanted->wish;
      place.due_at.reset();
    }
  }
}

bool ViewConnection::is_due(Place& place, Instant now) {
  const Duration period = from_seconds(1.0 / place.wish->per_second);
  const Duration early = from_seconds(kEarly / place.wish->per_second);
  if (place.due_at && now + early < *place.due_at) return false;
  // On the beat of the wish; after a gap the beat starts anew.
  const bool on_beat = place.due_at && now < *place.due_at + period;
  place.due_at = (on_beat ? *place.due_at : now) + period;
  return true;
}

void ViewConnection::offer(std::size_t camera, const CameraViews::Picture& picture, Instant now) {
  Place& place = places_[camera];
  if (!place.wish || !is_due(place, now)) return;
  if (place.waiting) ++dropped_;
  place.waiting = picture;
}

Message ViewConnection::next(Instant now) {
  if (writing_since_) return nullptr;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    Place& place = places_[(turn_ + i) % places_.size()];
    if (!place.waiting) continue;
    if (!sent_lately_.take(1, kMostPerSecond, kMostPerSecond, now)) return nullptr;
    turn_ = (turn_ + i + 1) % places_.size();
    writing_since_ = now;
    ++sent_;
    return std::exchange(place.waiting, nullptr);
  }
  return nullptr;
}

ClientStatus ViewConnection::status(Instant now) const {
  const auto watched = std::count_if(places_.begin(), places_.end(),
                                     [](const Place& place) { return place.wish.has_value(); });
  return {"web",
          net::text_of(peer_) + " tcp",
          "camera views, " + std::to_string(watched) + (watched == 1 ? " camera" : " cameras"),
          sent_,
          dropped_,
          to_seconds(now - connected_at_)};
}

}  // namespace fiducap::web
