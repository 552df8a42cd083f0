#include "mapping/moved_tags.hpp"

#include <algorithm>
#include <array>
#include <ctime>
#include <utility>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "base/text.hpp"
#include "estimation/filter/matrix6.hpp"

namespace fiducap {

namespace {

// Reports, and tags found in place, are used for this long.
constexpr Duration kRecently = std::chrono::seconds(10);
// Errors of maps, lenses and prints displace a tag by less than this, m and rad.
constexpr double kNear = 0.1;

// Moves at most this far apart are counted together; more than the limit exclude the tag.
constexpr Duration kMovesApart = std::chrono::minutes(10);
constexpr int kMostMoves = 3;
constexpr int kMostWithReturn = 2;  // … when one of them led back to a former place
// Sightings and time span that confirm an estimate: a door stands still for a moment.
constexpr int kSightingsToFind = 20;
constexpr Duration kTimeToFind = std::chrono::milliseconds(800);
// Two estimates differ when that is less likely than one in ten thousand (chi-square, 6).
constexpr double kOtherPlace = 27.9;
// A tag that was found in place is not displaced again within this time.
constexpr Duration kKeptFor = std::chrono::minutes(1);

std::string clock_time(std::int64_t utc_ns) {
  const auto seconds = static_cast<std::time_t>(utc_ns / 1'000'000'000);
  std::tm parts{};
  std::array<char, 16> text{};
  if (gmtime_r(&seconds, &parts) == nullptr) return "?";
  const auto size = std::strftime(text.data(), text.size(), "%H:%M:%S", &parts);
  return {text.data(), size};
}

std::string place(const Pose& X) {
  return std::string("(") + fixed(X.p.x(), 2) + " " + fixed(X.p.y(), 2) + " " + fixed(X.p.z(), 2) +
         ")";
}

std::string name(int tag_id) { return "tag " + std::to_string(tag_id); }

bool was_at(const Pose& place, std::span<const Pose> places) {
  return std::ranges::any_of(places,
                             [&](const Pose& other) { return (place.p - other.p).norm() < kNear; });
}

/// It was found at a place that it had left.
bool has_come_back(std::span<const Pose> places) {
  for (std::size_t i = 2; i < places.size(); ++i)
    if (was_at(places[i], places.first(i - 1))) return true;
  return false;
}

std::string likely_cause(const std::vector<Pose>& places) {
  double widest_m = 0;
  const Pose* far = nullptr;
  for (const Pose& one : places) {
    const double away_m = (one.p - places.front().p).norm();
    if (away_m > widest_m) {
      widest_m = away_m;
      far = &one;
    }
  }
  if (places.size() < 2)
    return "it is never still for long: it is attached to something that moves";
  if (widest_m < kNear)
    return "its places are " + fixed(1e3 * widest_m, 0) +
           " mm apart: its size may differ from the configured one, or it is loosely attached";
  const std::string where = "it was found at " + place(places.front()) + " and " + place(*far) +
                            ", " + fixed(widest_m, 2) + " m apart: ";
  return where + (has_come_back(places)
                      ? "two printed tags have the same id, or it is on a door"
                      : "it is attached to something that moves, or two printed tags have the "
                        "same id");
}

}  // namespace

bool is_near(const Pose& a, const Pose& b) {
  return (a.p - b.p).norm() < kNear && angle_between(a.q, b.q) < kNear;
}

/// Neglects that the errors of both are correlated.
bool is_same_place(const KnownTag& a, const KnownTag& b) {
  Vector6d e;
  e << a.X_WT.p - b.X_WT.p, log_so3(a.X_WT.q * b.X_WT.q.conjugate());
  return is_near(a.X_WT, b.X_WT) && squared_distance(e, a.covariance + b.covariance) < kOtherPlace;
}

bool is_confirmed(int sightings, Duration seen_for) {
  return sightings >= kSightingsToFind && seen_for >= kTimeToFind;
}

// --- TagWatch ---

std::vector<TagDisplacement> TagWatch::report(int body_id, Instant at, std::span<const int> fitting,
                                              std::span<const Contradiction> contradicted) {
  OfBody& body = bodies_[body_id];
  const auto is_old = [&](Instant then) { return then < at - kRecently; };
  std::erase_if(body.fitted, [&](const auto& entry) { return is_old(entry.second); });
  std::erase_if(body.contradicted, [&](const auto& entry) { return is_old(entry.second.at); });
  const bool had_found_two = body.fitted.size() > 1;
  note_fitting(body, at, fitting);
  std::vector<TagDisplacement> gone;
  for (const Contradiction& one : contradicted) {
    const int tag_id = one.in_map.tag_id;
    const auto [entry, is_new] = body.contradicted.try_emplace(tag_id);
    if (is_new) entry->second = {at, at, had_found_two, one};
    entry->second.at = at;
    entry->second.how = one;
    body.fitted.erase(tag_id);
  }
  for (const Contradiction& one : contradicted) {
    const int tag_id = one.in_map.tag_id;
    if (!is_moved(body, tag_id)) continue;
    const OfTag& tag = tags_[tag_id];
    gone.push_back({tag_id, tag.fitted_at ? tag.fitted_at : tag.fitted_alone_at, at, body_id});
  }
  return gone;
}

void TagWatch::note_fitting(OfBody& body, Instant at, std::span<const int> fitting) {
  for (const int tag_id : fitting) {
    body.fitted[tag_id] = at;
    if (fitting.size() == 1) {
      tags_[tag_id].fitted_alone_at = at;
    } else {
      tags_[tag_id].fitted_at = at;
      body.contradicted.erase(tag_id);
    }
  }
}

void TagWatch::forget(int tag_id) {
  tags_.erase(tag_id);
  for (auto& [body_id, body] : bodies_) {
    body.fitted.erase(tag_id);
    body.contradicted.erase(tag_id);
  }
}

/// Contradicted tags that the displacement of this one explains; those without an estimate may
/// have any.
int TagWatch::displaced_equally(const OfBody& body, const Contradiction& one) {
  const Pose T = one.own->tag.X_WT * one.in_map.X_WT.inverse();
  return static_cast<int>(std::ranges::count_if(body.contradicted, [&](const auto& entry) {
    const Contradiction& other = entry.second.how;
    return !other.own || is_near(T * other.in_map.X_WT, other.own->tag.X_WT);
  }));
}

bool TagWatch::is_moved(const OfBody& body, int tag_id) const {
  const OfBody::Contradicted& one = body.contradicted.at(tag_id);
  const std::optional<TagBelief>& own = one.how.own;
  if (!own || !is_confirmed(own->sightings, own->last_seen - own->first_seen) ||
      is_same_place(own->tag, one.how.in_map))
    return false;
  const auto tag = tags_.find(tag_id);
  if (tag != tags_.end() && tag->second.fitted_at && *tag->second.fitted_at > one.since)
    return false;
  const auto in_place = std::ranges::count_if(
      body.fitted, [&](const auto& entry) { return entry.second >= one.since; });
  return static_cast<int>(in_place) + (one.had_found_two ? 1 : 0) >
         displaced_equally(body, one.how);
}

// --- MovedTags ---

std::optional<MapEvent> MovedTags::displace(const TagDisplacement& displacement,
                                            const MapTag& entry, std::int64_t utc_now_ns) {
  const int tag_id = displacement.tag_id;
  History& tag = tags_[tag_id];
  if (tag.is_excluded) return std::nullopt;
  if (tag.kept_at && displacement.at - *tag.kept_at < kKeptFor) return std::nullopt;
  tag.moves = displacement.at - tag.last_moved < kMovesApart ? tag.moves + 1 : 1;
  tag.last_moved = displacement.at;
  if (!tag.is_away) {
    // Sightings that located the tag belong to its newest place.
    tag.gone = std::max(displacement.fitted_at.value_or(Instant::min()), tag.found_until);
    tag.before = entry.state;
    tag.places.push_back(entry.tag.X_WT);
  }
  tag.seen = "before " + clock_time(utc_now_ns);
  if (tag.gone != Instant::min())
    tag.seen = "between " + clock_time(utc_now_ns - (displacement.at - tag.gone).count()) +
               " and " + clock_time(utc_now_ns);
  tag.seen += " UTC, seen by body " + std::to_string(displacement.body_id);
  tag.is_away = true;
  ++tag.epoch;
  const int most = has_come_back(tag.places) ? kMostWithReturn : kMostMoves;
  if (tag.moves > most) return exclude(tag_id, tag);
  orders_.push_back({tag_id, TagEpoch{tag.gone, displacement.at}});
  return MapEvent{MapEvent::Kind::kTagQuarantined, tag_id,
                  name(tag_id) + " has left its place " + tag.seen +
                      ": it is not used until its new place is known"};
}

MapEvent MovedTags::exclude(int tag_id, History& tag) {
  tag.is_excluded = true;
  orders_.push_back({tag_id, TagEpoch{tag.gone, Instant::max()}});
  return {MapEvent::Kind::kTagQuarantined, tag_id,
          name(tag_id) + " has left its place " + std::to_string(tag.moves) +
              " times and is not used any more: " + likely_cause(tag.places)};
}

bool MovedTags::is_away(int tag_id) const {
  const auto found = tags_.find(tag_id);
  return found != tags_.end() && found->second.is_away;
}

bool MovedTags::is_outdated(const GraphTagEstimate& tag) const {
  const auto found = tags_.find(tag.tag_id);
  return !tag.is_current || (found != tags_.end() && found->second.epoch != tag.epoch);
}

std::optional<MovedTags::Found> MovedTags::locate(const GraphTagEstimate& found,
                                                  std::span<const GraphTagEstimate> all,
                                                  const MapTag& entry) {
  History& history = tags_.at(found.tag_id);
  if (history.is_excluded || !is_confirmed(found.sightings, found.last_seen - found.first_seen))
    return std::nullopt;
  // The graph's estimate of the old place may be newer than the map's.
  KnownTag before = entry.tag;
  for (const GraphTagEstimate& tag : all) {
    const bool is_older =
        tag.tag_id == found.tag_id && tag.component == found.component && tag.epoch < found.epoch;
    if (is_older) before = {tag.tag_id, tag.edge_m, tag.X_WT, tag.covariance};
  }
  history.is_away = false;
  history.found_until = found.last_seen;
  const double moved_m = (found.X_WT.p - before.X_WT.p).norm();
  const KnownTag now{found.tag_id, found.edge_m, found.X_WT, found.covariance};
  if (is_same_place(now, before)) {
    --history.epoch;
    orders_.push_back({found.tag_id, std::nullopt});
    history.kept_at = found.last_seen;
    history.places.pop_back();
    return Found{{MapEvent::Kind::kTagDisputed, found.tag_id,
                  name(found.tag_id) + " is in its old place, within " + fixed(1e3 * moved_m, 0) +
                      " mm, and is used again: it was not away, or only briefly, " + history.seen},
                 history.before};
  }
  const bool is_back =
      was_at(found.X_WT, std::span(history.places).first(history.places.size() - 1));
  const double turned = kDegreesPerRadian * angle_between(found.X_WT.q, before.X_WT.q);
  return Found{
      {MapEvent::Kind::kTagMoved, found.tag_id,
       name(found.tag_id) + " was moved by " + fixed(1e3 * moved_m, 0) + " mm and " +
           fixed(turned, 1) + "° " + history.seen +
           (is_back ? ", back to a place it had left" : "") + ": it is used at its new place"},
      TagState::kLocal};
}

void MovedTags::exclude(int tag_id, Instant at) {
  History& tag = tags_[tag_id];
  ++tag.epoch;
  tag.is_away = tag.is_excluded = true;
  orders_.push_back({tag_id, TagEpoch{at, Instant::max()}});
}

void MovedTags::forget(int tag_id, Instant at) {
  tags_[tag_id] = {.epoch = tags_[tag_id].epoch + 1};
  orders_.push_back({tag_id, TagEpoch{at, at}});
}

std::vector<EpochOrder> MovedTags::take_orders() { return std::exchange(orders_, {}); }

}  // namespace fiducap
