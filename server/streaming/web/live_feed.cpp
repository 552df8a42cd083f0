#include "streaming/web/live_feed.hpp"

#include <algorithm>
#include <utility>

#include "streaming/web/codec.hpp"

namespace fiducap::web {

namespace {

using namespace std::chrono_literals;

constexpr Duration kTickPeriod = 1s;
// While mapping, a map may change with every image; a page is served well by two a second.
constexpr Duration kMapPeriod = 500ms;
// A frame this much early is taken: waiting for the next one would halve the rate of a jittering
// publisher.
constexpr Duration kJitter = 2ms;
constexpr Duration kFrozenAfter = 2s;

Message shared(std::string text) { return std::make_shared<const std::string>(std::move(text)); }

}  // namespace

LiveFeed::LiveFeed(const WebConfig& config, WebSources sources,
                   std::shared_ptr<const SceneModel> model)
    : frame_period_(from_seconds(1.0 / config.rate_hz)),
      sources_(std::move(sources)),
      model_(std::move(model)),
      told_mode_(sources_.map_mode ? sources_.map_mode() : std::string()) {}

std::shared_ptr<LiveConnection> LiveFeed::join(std::string peer, Instant now) {
  auto connection = std::make_shared<LiveConnection>(std::move(peer), now);
  connections_.push_back(connection);
  connection->offer(Topic::kHello, hello());
  if (sent_map_) connection->offer(Topic::kMap, shared(encode_map(*sent_map_)));
  if (newest_) connection->offer(Topic::kFrame, shared(encode_frame(*newest_)));
  connection->offer(Topic::kClients, clients());
  offer_log(*connection);
  return connection;
}

void LiveFeed::leave(const LiveConnection& connection) {
  std::erase_if(connections_, [&](const auto& held) { return held.get() == &connection; });
}

void LiveFeed::publish(const std::shared_ptr<const SceneFrame>& frame) {
  newest_ = frame;
  if (frame->model && frame->model->generation != model_->generation) {
    model_ = frame->model;
    if (!connections_.empty()) offer_all(Topic::kHello, hello());
  }
  publish_map(*frame);
  if (frame_due(frame->published_at) && !connections_.empty()) {
    offer_all(Topic::kFrame, shared(encode_frame(*frame)));
  }
}

void LiveFeed::publish_map(const SceneFrame& frame) {
  if (!frame.map || frame.map == sent_map_) return;
  if (map_sent_at_ && frame.published_at - *map_sent_at_ < kMapPeriod) return;
  sent_map_ = frame.map;
  map_sent_at_ = frame.published_at;
  if (!connections_.empty()) offer_all(Topic::kMap, shared(encode_map(*sent_map_)));
}

bool LiveFeed::frame_due(Instant at) {
  if (next_frame_at_ && at + kJitter < *next_frame_at_) return false;
  // On the beat of the wanted rate; after a gap the beat starts anew.
  const bool on_beat = next_frame_at_ && at < *next_frame_at_ + frame_period_;
  next_frame_at_ = (on_beat ? *next_frame_at_ : at) + frame_period_;
  return true;
}

void LiveFeed::tick(Instant now) {
  if (ticked_at_ && now - *ticked_at_ < kTickPeriod) return;
  ticked_at_ = now;
  const std::string mode = sources_.map_mode ? sources_.map_mode() : std::string();
  const bool is_news = mode != told_mode_;
  told_mode_ = mode;
  if (connections_.empty()) return;
  if (is_news) offer_all(Topic::kHello, hello());
  offer_all(Topic::kClients, clients());
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
  return shared(encode_hello(
      {sources_.server_name, sources_.version, told_mode_, 1.0 / to_seconds(frame_period_)},
      *model_));
}

Message LiveFeed::clients() const {
  return shared(
      encode_clients(sources_.clients ? sources_.clients() : std::vector<ClientStatus>{}));
}

std::string LiveFeed::state() const {
  const std::string map = newest_ && newest_->map ? encode_map(*newest_->map) : std::string();
  const std::string frame = newest_ ? encode_frame(*newest_) : std::string();
  return encode_state({*hello(), map, frame, *clients(), encode_log(log::lines_after(0))});
}

std::string LiveFeed::trouble(Instant now) const {
  if (!newest_) return "no frame was published yet";
  return now - newest_->published_at > kFrozenAfter ? "frames stopped" : "";
}

}  // namespace fiducap::web
