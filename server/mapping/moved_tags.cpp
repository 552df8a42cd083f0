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

// The reliability of a body depends on the tags that it has found in place just now, and on those
// that it contradicted recently and has not found in place since.
constexpr Duration kJustNow = std::chrono::seconds(2);
constexpr Duration kRecently = std::chrono::seconds(10);
constexpr std::size_t kFittingBesideOne = 2;
constexpr std::size_t kFittingPerContradicted = 3;
// Robots pass a tag now and then: a report is kept this long, unless the tag is found in place.
constexpr Duration kReportLifetime = std::chrono::minutes(10);
// A filter takes half a second for each: a lost body contradicts the next tag meanwhile.
constexpr std::size_t kReportsToDecide = 3;

// Without a sighting in place the tag left it this long before the first report.
constexpr Duration kBeforeFirstReport = std::chrono::seconds(2);
// Moves at most this far apart are counted together; more than the limit exclude the tag.
constexpr Duration kMovesApart = std::chrono::minutes(10);
constexpr int kMostMoves = 3;
constexpr int kMostWithReturn = 2;  // … when one of them led back to a former place
// Sightings and time span that confirm a new place: a door stands still for a moment.
constexpr int kSightingsToFind = 20;
constexpr Duration kTimeToFind = std::chrono::milliseconds(800);
// Old and new place differ when that is less likely than one in ten thousand (chi-square, 6).
constexpr double kOtherPlace = 27.9;
// A tag that was found in place is not displaced again within this time.
constexpr Duration kKeptFor = std::chrono::minutes(1);
// Places nearer than this are the same one.
constexpr double kSamePlace_m = 0.1;

void forget_before(Instant since, std::map<int, Instant>& times) {
  std::erase_if(times, [&](const auto& entry) { return entry.second < since; });
}

std::string clock_time(std::int64_t utc_ns) {
  const auto seconds = static_cast<std::time_t>(utc_ns / 1'000'000'000);
  std::tm parts{};
  std::array<char, 16> text{};
  if (gmtime_r(&seconds, &parts) == nullptr) return "?";
  const auto size = std::strftime(text.data(), text.size(), "%H:%M:%S", &parts);
  return {text.data(), size};
}

std::string list(const std::set<int>& bodies) {
  return (bodies.size() > 1 ? "bodies " : "body ") +
         comma_list(bodies, [](int body_id) { return std::to_string(body_id); });
}

std::string place(const Pose& X) {
  return std::string("(") + fixed(X.p.x(), 2) + " " + fixed(X.p.y(), 2) + " " + fixed(X.p.z(), 2) +
         ")";
}

std::string name(int tag_id) { return "tag " + std::to_string(tag_id); }

/// Squared, normalised by both covariances; neglects that their errors are correlated.
double distance(const GraphTagEstimate& a, const KnownTag& b) {
  Vector6d e;
  e << a.X_WT.p - b.X_WT.p, log_so3(a.X_WT.q * b.X_WT.q.conjugate());
  return squared_distance(e, a.covariance + b.covariance);
}

bool was_at(const Pose& place, std::span<const Pose> places) {
  return std::ranges::any_of(
      places, [&](const Pose& other) { return (place.p - other.p).norm() < kSamePlace_m; });
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
  if (widest_m < kSamePlace_m)
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

// --- TagWatch ---

std::vector<TagDisplacement> TagWatch::report(int body_id, Instant at, std::span<const int> fitting,
                                              std::span<const int> contradicted) {
  OfBody& body = bodies_[body_id];
  for (const int tag_id : fitting) {
    OfTag& tag = tags_[tag_id];
    body.fitted[tag_id] = at;
    if (fitting.size() == 1) {
      tag.fitted_alone_at = at;
      continue;
    }
    body.contradicted.erase(tag_id);
    tag.fitted_at = at;
    tag.reports.clear();
  }
  std::vector<TagDisplacement> gone;
  if (contradicted.empty()) return gone;
  for (const int tag_id : contradicted) body.contradicted[tag_id] = at;
  if (!is_reliable(body, at)) {
    for (auto& [tag_id, tag] : tags_)
      std::erase_if(tag.reports, [&](const Report& one) { return one.body_id == body_id; });
    return gone;
  }
  for (const int tag_id : contradicted) tags_[tag_id].reports.push_back({body_id, at});
  for (const int tag_id : contradicted)
    if (auto displacement = decide(tag_id, at)) gone.push_back(std::move(*displacement));
  return gone;
}

void TagWatch::forget(int tag_id) {
  tags_.erase(tag_id);
  for (auto& [body_id, body] : bodies_) body.fitted.erase(tag_id);
}

bool TagWatch::is_reliable(OfBody& body, Instant at) {
  forget_before(at - kJustNow, body.fitted);
  forget_before(at - kRecently, body.contradicted);
  const auto fits = static_cast<std::size_t>(std::ranges::count_if(
      body.fitted, [&](const auto& entry) { return !body.contradicted.contains(entry.first); }));
  const std::size_t contradicted = body.contradicted.size();
  return fits >= (contradicted > 1 ? kFittingPerContradicted * contradicted : kFittingBesideOne);
}

std::optional<TagDisplacement> TagWatch::decide(int tag_id, Instant at) {
  OfTag& tag = tags_[tag_id];
  std::erase_if(tag.reports, [&](const Report& one) { return one.at < at - kReportLifetime; });
  if (tag.reports.size() < kReportsToDecide) return std::nullopt;
  TagDisplacement out{.tag_id = tag_id,
                      .fitted_at = tag.fitted_at ? tag.fitted_at : tag.fitted_alone_at,
                      .first_report_at = tag.reports.front().at,
                      .at = at,
                      .by = {}};
  for (const Report& one : tag.reports) out.by.insert(one.body_id);
  tag.reports.clear();
  return out;
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
    const Instant gone =
        displacement.fitted_at.value_or(displacement.first_report_at - kBeforeFirstReport);
    // Sightings that located the tag belong to its newest place.
    tag.gone = std::max(gone, tag.found_until);
    tag.before = entry.state;
    tag.places.push_back(entry.tag.X_WT);
  }
  const std::int64_t gone_utc_ns = utc_now_ns - (displacement.at - tag.gone).count();
  tag.seen = "between " + clock_time(gone_utc_ns) + " and " + clock_time(utc_now_ns) +
             " UTC, seen by " + list(displacement.by);
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
  if (history.is_excluded || found.sightings < kSightingsToFind ||
      found.last_seen - found.first_seen < kTimeToFind)
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
  if (moved_m < kSamePlace_m && distance(found, before) < kOtherPlace) {
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
