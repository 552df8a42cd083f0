#include "mapping/moved_tags.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <utility>

#include <Eigen/Cholesky>

#include "base/so3.hpp"
#include "base/text.hpp"

namespace fiducap {

namespace {

// Where nobody ever found it in its place: it was contradicted from about here on.
constexpr Duration kBeforeFirstWord = std::chrono::seconds(2);
// Moves count together when they are not further apart; so many, and the tag is given up.
constexpr Duration kMoveCounts = std::chrono::minutes(10);
constexpr int kMostMoves = 3;
constexpr int kMostWithReturn = 2;  // … when one of them led back to where it was
// A new place is believed by so many sightings over so long: a door stands still for a moment.
constexpr int kSightingsToFind = 20;
constexpr Duration kTimeToFind = std::chrono::milliseconds(800);
// Old and new place differ when that is less likely than one in ten thousand (chi-square, 6).
constexpr double kOtherPlace = 27.9;
constexpr Duration kDisputeHolds = std::chrono::minutes(1);
// Places nearer than this are one place, seen badly …
constexpr double kSamePlace_m = 0.1;
constexpr double kDegrees = 180 / M_PI;

std::string clock_time(std::int64_t utc_ns) {
  const auto seconds = static_cast<std::time_t>(utc_ns / 1'000'000'000);
  std::tm parts{};
  std::array<char, 16> text{};
  if (gmtime_r(&seconds, &parts) == nullptr) return "?";
  const auto size = std::strftime(text.data(), text.size(), "%H:%M:%S", &parts);
  return {text.data(), size};
}

std::string list(const std::set<int>& bodies) {
  std::string out;
  for (const int body_id : bodies) out += (out.empty() ? "" : ", ") + std::to_string(body_id);
  return (bodies.size() > 1 ? "bodies " : "body ") + out;
}

std::string place(const Pose& X) {
  return std::string("(") + fixed(X.p.x(), 2) + " " + fixed(X.p.y(), 2) + " " + fixed(X.p.z(), 2) +
         ")";
}

std::string name(int tag_id) { return "tag " + std::to_string(tag_id); }

/// Squared, in sigmas of both: what their errors share makes it smaller than it is.
double distance(const GraphTagEstimate& a, const KnownTag& b) {
  Vector6d e;
  e << a.X_WT.p - b.X_WT.p, log_so3(a.X_WT.q * b.X_WT.q.conjugate());
  return e.dot(Matrix6d(a.covariance + b.covariance).ldlt().solve(e));
}

/// It has been at this place before.
bool was_at(const Pose& place, std::span<const Pose> places) {
  return std::any_of(places.begin(), places.end(),
                     [&](const Pose& other) { return (place.p - other.p).norm() < kSamePlace_m; });
}

/// It was found at a place that it had left.
bool has_come_back(std::span<const Pose> places) {
  for (std::size_t i = 2; i < places.size(); ++i)
    if (was_at(places[i], places.first(i - 1))) return true;
  return false;
}

/// What the places of a tag say about it.
std::string likely_cause(const std::vector<Pose>& places) {
  double widest_m = 0;
  const Pose* far = nullptr;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double away_m = (places[i].p - places.front().p).norm();
    if (away_m > widest_m) {
      widest_m = away_m;
      far = &places[i];
    }
  }
  if (places.size() < 2) return "it is never still for long: it hangs on something that moves";
  if (widest_m < kSamePlace_m) {
    return "its places are " + fixed(1e3 * widest_m, 0) +
           " mm apart: its size may be other than configured, or it hangs loosely";
  }
  const std::string where = "it was found at " + place(places.front()) + " and " + place(*far) +
                            ", " + fixed(widest_m, 2) + " m apart: ";
  return where + (has_come_back(places)
                      ? "two prints have the same id, or it hangs on a door"
                      : "it hangs on something that moves, or two prints have the same id");
}

}  // namespace

std::optional<MapEvent> MovedTags::suspect(const TagSuspicion& suspicion, const MapTag& entry,
                                           std::int64_t utc_now_ns) {
  const int tag_id = suspicion.tag_id;
  Case& one = cases_[tag_id];
  if (one.is_given_up) return std::nullopt;
  if (one.disputed_at && suspicion.at - *one.disputed_at < kDisputeHolds) return std::nullopt;
  one.moves = suspicion.at - one.last_moved < kMoveCounts ? one.moves + 1 : 1;
  one.last_moved = suspicion.at;
  if (!one.is_away) {
    const Instant gone = suspicion.fitted_at.value_or(suspicion.first_word_at - kBeforeFirstWord);
    // What it was found by is of the place where it was found.
    one.gone = std::max(gone, one.found_until);
    one.before = entry.state;
    one.places.push_back(entry.tag.X_WT);
  }
  const std::int64_t gone_utc_ns = utc_now_ns - (suspicion.at - one.gone).count();
  one.told = "between " + clock_time(gone_utc_ns) + " and " + clock_time(utc_now_ns) +
             " UTC, seen by " + list(suspicion.by);
  one.is_away = true;
  ++one.epoch;
  const int most = has_come_back(one.places) ? kMostWithReturn : kMostMoves;
  if (one.moves > most) return give_up(tag_id, one);
  orders_.push_back({tag_id, TagEpoch{one.gone, suspicion.at}});
  return MapEvent{MapEvent::Kind::kTagQuarantined, tag_id,
                  name(tag_id) + " has left its place " + one.told +
                      ": it is not used until its new place is known"};
}

MapEvent MovedTags::give_up(int tag_id, Case& one) {
  one.is_given_up = true;
  orders_.push_back({tag_id, TagEpoch{one.gone, Instant::max()}});
  return {MapEvent::Kind::kTagQuarantined, tag_id,
          name(tag_id) + " has left its place " + std::to_string(one.moves) +
              " times and is not used any more: " + likely_cause(one.places)};
}

bool MovedTags::is_away(int tag_id) const {
  const auto found = cases_.find(tag_id);
  return found != cases_.end() && found->second.is_away;
}

bool MovedTags::is_outdated(const GraphTagEstimate& tag) const {
  const auto found = cases_.find(tag.tag_id);
  return !tag.is_current || (found != cases_.end() && found->second.epoch != tag.epoch);
}

std::optional<MovedTags::Found> MovedTags::judge(const GraphTagEstimate& found,
                                                 std::span<const GraphTagEstimate> all,
                                                 const MapTag& entry) {
  Case& one = cases_.at(found.tag_id);
  if (one.is_given_up || found.sightings < kSightingsToFind ||
      found.last_seen - found.first_seen < kTimeToFind)
    return std::nullopt;
  // The graph may have learned of the old place since.
  KnownTag before = entry.tag;
  for (const GraphTagEstimate& tag : all) {
    const bool is_older =
        tag.tag_id == found.tag_id && tag.component == found.component && tag.epoch < found.epoch;
    if (is_older) before = {tag.tag_id, tag.edge_m, tag.X_WT, tag.covariance};
  }
  one.is_away = false;
  one.found_until = found.last_seen;
  const double moved_m = (found.X_WT.p - before.X_WT.p).norm();
  if (moved_m < kSamePlace_m && distance(found, before) < kOtherPlace) {
    --one.epoch;
    orders_.push_back({found.tag_id, std::nullopt});
    one.disputed_at = found.last_seen;
    one.places.pop_back();
    return Found{{MapEvent::Kind::kTagDisputed, found.tag_id,
                  name(found.tag_id) + " is where it was, within " + fixed(1e3 * moved_m, 0) +
                      " mm, and is used again: it was not away, or not for long, " + one.told},
                 one.before};
  }
  const bool is_back = was_at(found.X_WT, std::span(one.places).first(one.places.size() - 1));
  const double turned = kDegrees * angle_between(found.X_WT.q, before.X_WT.q);
  return Found{
      {MapEvent::Kind::kTagMoved, found.tag_id,
       name(found.tag_id) + " was moved by " + fixed(1e3 * moved_m, 0) + " mm and " +
           fixed(turned, 1) + "° " + one.told + (is_back ? ", back to a place it had left" : "") +
           ": it is used where it is now"},
      TagState::kLocal};
}

void MovedTags::set_aside(int tag_id, Instant at) {
  Case& one = cases_[tag_id];
  ++one.epoch;
  one.is_away = one.is_given_up = true;
  orders_.push_back({tag_id, TagEpoch{at, Instant::max()}});
}

void MovedTags::forget(int tag_id, Instant at) {
  cases_[tag_id] = {.epoch = cases_[tag_id].epoch + 1};
  orders_.push_back({tag_id, TagEpoch{at, at}});
}

std::vector<EpochOrder> MovedTags::take_orders() { return std::exchange(orders_, {}); }

}  // namespace fiducap
