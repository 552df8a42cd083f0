#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "streaming/web/live_connection.hpp"
#include "streaming/web/web_server.hpp"

namespace fiducap::web {

/// What the live pages get, and when: frames at the page's rate, the map when it changes, clients
/// and log once a second. Encodes once for all pages, and not at all while nobody looks. No socket,
/// no thread; time comes in.
class LiveFeed final {
 public:
  LiveFeed(const WebConfig& config, WebSources sources, std::shared_ptr<const SceneModel> model);

  /// A new page; hello, map, newest frame, clients and log wait for it already.
  [[nodiscard]] std::shared_ptr<LiveConnection> join(std::string peer, Instant now);
  void leave(const LiveConnection& connection);

  void publish(const std::shared_ptr<const SceneFrame>& frame);
  /// Clients and log, when a second has passed since the last time.
  void tick(Instant now);

  [[nodiscard]] const std::vector<std::shared_ptr<LiveConnection>>& connections() const {
    return connections_;
  }
  /// JSON of `/api/v1/state`.
  [[nodiscard]] std::string state() const;
  /// Empty when frames flow; else one sentence.
  [[nodiscard]] std::string trouble(Instant now) const;

 private:
  [[nodiscard]] bool frame_due(Instant at);
  void offer_all(Topic topic, const Message& message);
  void publish_map(const SceneFrame& frame);
  void offer_log(LiveConnection& connection) const;
  [[nodiscard]] Message hello() const;
  [[nodiscard]] Message clients() const;

  Duration frame_period_;
  WebSources sources_;
  std::shared_ptr<const SceneModel> model_;
  std::string told_mode_;  ///< Of the map, as the pages know it.
  std::shared_ptr<const SceneFrame> newest_;
  std::shared_ptr<const TagMap> sent_map_;
  std::optional<Instant> map_sent_at_;
  std::optional<Instant> next_frame_at_;
  std::optional<Instant> ticked_at_;
  std::vector<std::shared_ptr<LiveConnection>> connections_;
};

}  // namespace fiducap::web
