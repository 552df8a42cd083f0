#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "streaming/web/client_tally.hpp"
#include "streaming/web/content.hpp"
#include "streaming/web/http_routes.hpp"
#include "streaming/web/live_connection.hpp"
#include "streaming/web/metrics.hpp"
#include "streaming/web/web_server.hpp"

namespace fiducap::web {

/// What the live pages get, and when: frames at the page's rate, the map and the events when they
/// change, clients, log and how well tags are seen once a second. Encodes once for all pages, and
/// not at all while nobody looks. No socket, no thread; time comes in.
class LiveFeed final {
 public:
  LiveFeed(const WebConfig& config, WebSources sources, std::shared_ptr<const SceneModel> model);

  /// A new page; hello, events, map, newest frame, clients and log wait for it already.
  [[nodiscard]] std::shared_ptr<LiveConnection> join(const net::Peer& peer, Instant now);
  void leave(const LiveConnection& connection);
  /// Somebody else gets the place of this address's newest page.
  void dismiss_newest_of(const net::Peer& address);

  void publish(const std::shared_ptr<const SceneFrame>& frame);
  /// Clients and log, when a second has passed since the last time; events, when a half has.
  void tick(Instant now);

  [[nodiscard]] const std::vector<std::shared_ptr<LiveConnection>>& connections() const {
    return connections_;
  }
  /// JSON of `/api/v1/state`.
  [[nodiscard]] const Content& state(Instant now);
  [[nodiscard]] const Content& metrics(MetricsFormat format, Instant now);
  [[nodiscard]] Health health(Instant now) const;
  /// JSON of `/api/v1/map/versions`, and of how two of them differ: nullopt while they are read.
  [[nodiscard]] const Content& versions(Instant now);
  [[nodiscard]] Expected<std::optional<Content>> diff(std::int64_t before, std::int64_t after);

 private:
  [[nodiscard]] bool frame_due(Instant at);
  void offer_all(Topic topic, const Message& message);
  void publish_map(const SceneFrame& frame);
  void offer_log(LiveConnection& connection) const;
  void offer_events(Instant now);
  [[nodiscard]] Message hello() const;
  [[nodiscard]] Message map(const std::shared_ptr<const TagMap>& wanted);
  [[nodiscard]] Message clients() const;
  /// @return nullptr: no tag was seen within this time
  [[nodiscard]] Message fits(Duration within) const;
  [[nodiscard]] Message events() const;
  [[nodiscard]] std::vector<ClientStatus> all_clients() const;
  [[nodiscard]] std::string encode_state_now();
  [[nodiscard]] std::string encode_metrics_now(MetricsFormat format, Instant now) const;

  Duration frame_period_;
  WebSources sources_;
  std::shared_ptr<const SceneModel> model_;
  std::string told_mode_;  ///< Of the map, as the pages know it.
  std::shared_ptr<const SceneFrame> newest_;
  std::shared_ptr<const TagMap> sent_map_;
  std::optional<Instant> map_sent_at_;
  std::optional<Instant> next_frame_at_;
  std::optional<Instant> ticked_at_;
  std::optional<Instant> events_looked_at_;
  std::uint64_t told_revision_{0};
  std::shared_ptr<const TagMap> encoded_map_;
  Message map_message_;  ///< Of `encoded_map_`.
  ClientTally tally_;
  Prepared state_;
  Prepared versions_;
  std::array<Prepared, 2> metrics_;  ///< By MetricsFormat.
  std::vector<std::shared_ptr<LiveConnection>> connections_;
};

}  // namespace fiducap::web
