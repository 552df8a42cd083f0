#include "streaming/web/live_feed.hpp"

#include <algorithm>
#include <iterator>
#include <span>
#include <utility>

#include "streaming/conventions/frame_sequence.hpp"
#include "streaming/operator_api.hpp"
#include "streaming/web/codec.hpp"

namespace fiducap::web {

namespace {

constexpr std::size_t slot(Topic topic) { return static_cast<std::size_t>(topic); }

using namespace std::chrono_literals;

constexpr Duration kTickPeriod = 1s;
// While mapping, the map may change with every image.
constexpr Duration kMapPeriod = 500ms;
constexpr Duration kEventsPeriod = 500ms;
// Longer than a tick, so that no sighting is missed.
constexpr Duration kFitsOf = 3s;
constexpr std::size_t kNewestEvents = 64;  // of the board
// A frame may be this much early; else jitter would halve the rate.
constexpr Duration kJitter = 2ms;
constexpr Duration kFrozenAfter = 2s;

Message shared(std::string text) { return std::make_shared<const std::string>(std::move(text)); }

}  // namespace

void LiveConnection::offer(Topic topic, Message message) {
  auto& place = waiting_[slot(topic)];
  if (topic == Topic::kFrame && place) ++dropped_;
  place = std::move(message);
}

void LiveConnection::offer_log(Message message, std::uint64_t last_number) {
  waiting_[slot(Topic::kLog)] = std::move(message);
  log_given_ = last_number;
}

void LiveConnection::give_ticket() {
  ticket_ = net::random_secret();
  offer(Topic::kTicket, shared(encode_ticket(ticket_)));
}

std::optional<std::uint64_t> LiveConnection::log_wanted_after() const {
  if (waiting_[slot(Topic::kLog)]) return std::nullopt;
  return log_given_;
}

Message LiveConnection::next(Instant now) {
  if (writing_since_) return nullptr;
  for (std::size_t i = 0; i < kTopics; ++i) {
    if (!waiting_[i]) continue;
    if (i == slot(Topic::kFrame)) ++sent_;
    writing_since_ = now;
    return std::exchange(waiting_[i], nullptr);
  }
  return nullptr;
}

LiveFeed::LiveFeed(const WebConfig& config, const ProtocolContext& context)
    : frame_period_(from_seconds(1.0 / config.rate_hz)),
      context_(context),
      model_(context.model),
      sent_mode_(map_mode()) {}

std::shared_ptr<LiveConnection> LiveFeed::join(const net::Peer& peer, Instant now) {
  auto connection = std::make_shared<LiveConnection>(peer, now);
  connections_.push_back(connection);
  connection->offer(Topic::kHello, hello());
  if (context_.events != nullptr) connection->offer(Topic::kEvents, events());
  if (sent_map_) connection->offer(Topic::kMap, map(sent_map_));
  if (newest_) connection->offer(Topic::kFrame, shared(encode_frame(*newest_)));
  if (const Message message = fits(Duration::max())) connection->offer(Topic::kFits, message);
  connection->offer(Topic::kClients, clients());
  offer_log(*connection);
  return connection;
}

void LiveFeed::leave(const LiveConnection& connection) {
  std::erase_if(connections_, [&](const auto& held) { return held.get() == &connection; });
}

void LiveFeed::dismiss_newest_of(const net::Peer& address) {
  const auto newest =
      std::find_if(connections_.rbegin(), connections_.rend(),
                   [&](const auto& held) { return held->peer().same_address(address); });
  if (newest == connections_.rend()) return;
  (*newest)->dismiss();
  connections_.erase(std::next(newest).base());
}

void LiveFeed::publish(const std::shared_ptr<const SceneFrame>& frame) {
  newest_ = frame;
  if (frame->model && frame->model->generation != model_->generation) {
    model_ = frame->model;
    if (!connections_.empty()) offer_all(Topic::kHello, hello());
  }
  publish_map(*frame);
  if (is_period_due(next_frame_at_, frame->published_at, frame_period_, kJitter) &&
      !connections_.empty()) {
    offer_all(Topic::kFrame, shared(encode_frame(*frame)));
  }
}

void LiveFeed::publish_map(const SceneFrame& frame) {
  if (!frame.map || frame.map == sent_map_) return;
  if (map_sent_at_ && frame.published_at - *map_sent_at_ < kMapPeriod) return;
  sent_map_ = frame.map;
  map_sent_at_ = frame.published_at;
  if (!connections_.empty()) offer_all(Topic::kMap, map(sent_map_));
}

Message LiveFeed::map(const std::shared_ptr<const TagMap>& wanted) {
  if (wanted != encoded_map_) {
    map_message_ = shared(encode_map(*wanted));
    encoded_map_ = wanted;
  }
  return map_message_;
}

void LiveFeed::tick(Instant now) {
  offer_events(now);
  if (ticked_at_ && now - *ticked_at_ < kTickPeriod) return;
  ticked_at_ = now;
  const std::string_view mode = map_mode();
  const bool has_changed = mode != sent_mode_;
  sent_mode_ = mode;
  const std::vector<ClientStatus> all = all_clients();
  tally_.note(all);
  if (connections_.empty()) return;
  if (has_changed) offer_all(Topic::kHello, hello());
  offer_all(Topic::kClients, shared(encode_clients(all)));
  if (const Message message = fits(kFitsOf)) offer_all(Topic::kFits, message);
  for (const auto& connection : connections_) offer_log(*connection);
}

void LiveFeed::offer_all(Topic topic, const Message& message) {
  for (const auto& connection : connections_) connection->offer(topic, message);
}

void LiveFeed::offer_log(LiveConnection& connection) const {
  const auto after = connection.log_wanted_after();
  if (!after) return;
  const auto lines = log::lines_after(*after);
  if (!lines.empty()) connection.offer_log(shared(encode_log(lines)), lines.back().number);
}

Message LiveFeed::hello() const {
  return shared(
      encode_hello({context_.version, sent_mode_, 1.0 / to_seconds(frame_period_),
                    context_.operator_api != nullptr && !context_.operator_api->token().empty()},
                   *model_));
}

std::string_view LiveFeed::map_mode() const {
  if (context_.operator_api == nullptr) return "";
  return context_.operator_api->map_mode() == MapMode::kFrozen ? "frozen" : "mapping";
}

Message LiveFeed::clients() const { return shared(encode_clients(all_clients())); }

Message LiveFeed::fits(Duration within) const {
  if (context_.operator_api == nullptr || !newest_) return nullptr;
  auto all = context_.operator_api->tag_fits();
  std::erase_if(all, [&](const TagFit& fit) { return newest_->at - fit.seen_at > within; });
  return all.empty() ? nullptr : shared(encode_fits(all, newest_->utc_offset));
}

std::vector<ClientStatus> LiveFeed::all_clients() const {
  return context_.clients ? context_.clients() : std::vector<ClientStatus>{};
}

void LiveFeed::offer_events(Instant now) {
  if (context_.events == nullptr) return;
  if (events_looked_at_ && now - *events_looked_at_ < kEventsPeriod) return;
  events_looked_at_ = now;
  const std::uint64_t revision = context_.events->revision();
  if (std::exchange(sent_revision_, revision) == revision || connections_.empty()) return;
  offer_all(Topic::kEvents, events());
}

Message LiveFeed::events() const {
  const auto kept = context_.events->after(0);
  const std::span<const Event> all(kept);
  return shared(
      encode_events(context_.events->standing(), all.last(std::min(all.size(), kNewestEvents))));
}

const Content& LiveFeed::state(Instant now) {
  return state_.at(now, [this] { return encode_state_now(); });
}

const Content& LiveFeed::versions(Instant now) {
  return versions_.at(now, [this] {
    return encode_versions(context_.operator_api != nullptr ? context_.operator_api->map_versions()
                                                            : std::vector<MapVersionInfo>{});
  });
}

Expected<std::optional<Content>> LiveFeed::diff(std::int64_t before, std::int64_t after) {
  OperatorApi* const api = context_.operator_api;
  if (api == nullptr) return fail(ErrorCode::kNotFound, "the map has no store");
  const auto first = api->map_version(before);
  if (!first) return tl::unexpected(first.error());
  const auto second = api->map_version(after);
  if (!second) return tl::unexpected(second.error());
  if (*first == nullptr || *second == nullptr) return std::nullopt;
  const auto served = api->map();
  const Pose X_RW = served ? served->X_RW : (*second)->X_RW;
  return make_content(encode_diff(**first, **second, X_RW), Effort::kQuick);
}

std::string LiveFeed::encode_state_now() {
  const Message frame = newest_ ? shared(encode_frame(*newest_)) : shared({});
  const Message at_map = newest_ && newest_->map ? map(newest_->map) : shared({});
  const Message seen = fits(Duration::max());
  const Message message = context_.events != nullptr ? events() : shared({});
  return encode_state({*hello(), *at_map, seen ? std::string_view(*seen) : std::string_view(),
                       *frame, *clients(), encode_log(log::lines_after(0)), *message});
}

const Content& LiveFeed::metrics(MetricsFormat format, Instant now) {
  return metrics_.at(static_cast<std::size_t>(format)).at(now, [&] {
    return encode_metrics_now(format, now);
  });
}

std::string LiveFeed::encode_metrics_now(MetricsFormat format, Instant now) const {
  const EventBoard* board = context_.events;
  const std::vector<Event> alarms = board != nullptr ? board->standing() : std::vector<Event>{};
  return encode_metrics(
      {.version = context_.version,
       .healthy = health(now).trouble.empty(),
       .frame = newest_.get(),
       .model = model_.get(),
       .protocols = tally_.traffic(),
       .alarms = alarms,
       .events = board != nullptr ? board->counts() : std::array<std::uint64_t, 3>{},
       .process = process_use()},
      format);
}

Health LiveFeed::health(Instant now) const {
  Health health;
  if (!newest_) {
    health.trouble = "no frame was published yet";
  } else if (now - newest_->published_at > kFrozenAfter) {
    health.trouble = "frames stopped";
  }
  if (context_.events == nullptr) return health;
  for (const Event& alarm : context_.events->standing())
    ++health.alarms.at(static_cast<std::size_t>(alarm.severity));
  return health;
}

}  // namespace fiducap::web
