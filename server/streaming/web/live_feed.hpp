#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/streamer.hpp"
#include "streaming/web/content.hpp"
#include "streaming/web/http_routes.hpp"
#include "streaming/web/metrics.hpp"
#include "streaming/web/web.hpp"

namespace fiducap::web {

/// One encoded message, shared by all pages that get it.
using Message = std::shared_ptr<const std::string>;

/// The kinds of messages, in the order in which waiting ones leave.
enum class Topic : std::size_t { kTicket, kHello, kEvents, kMap, kFits, kFrame, kClients, kLog };
inline constexpr std::size_t kTopics = 8;

/// One client of a feed, without its socket: one write at a time, and its counts.
class FeedClient {
 public:
  FeedClient(const net::Peer& peer, Instant connected_at)
      : peer_(peer), connected_at_(connected_at) {}
  [[nodiscard]] const net::Peer& peer() const { return peer_; }

  /// The message of `next` is written.
  void written() { writing_since_.reset(); }
  /// @return a write is pending for longer than `limit`
  [[nodiscard]] bool is_stuck(Instant now, Duration limit) const {
    return writing_since_ && now - *writing_since_ > limit;
  }
  /// Another client gets its place: it will be closed.
  void dismiss() { dismissed_ = true; }
  [[nodiscard]] bool dismissed() const { return dismissed_; }

 protected:
  [[nodiscard]] ClientStatus status(std::string detail, Instant now) const {
    return {"web",    net::text_of(peer_) + " tcp",   std::move(detail), sent_,
            dropped_, to_seconds(now - connected_at_)};
  }

  std::optional<Instant> writing_since_;
  std::uint64_t sent_{0};  ///< Frames or pictures.
  std::uint64_t dropped_{0};

 private:
  net::Peer peer_;
  Instant connected_at_;
  bool dismissed_{false};
};

/// One live page: keeps the newest message per topic, so a slow page costs at most eight messages.
/// Only frames count as dropped; log lines are collected.
class LiveConnection final : public FeedClient {
 public:
  using FeedClient::FeedClient;

  /// Replaces a waiting message of the same topic.
  void offer(Topic topic, Message message);
  /// A secret for HTTP requests while the page is connected: its user has proven a token.
  void give_ticket();
  [[nodiscard]] const std::string& ticket() const { return ticket_; }
  /// Log lines up to `last_number`. @pre log_wanted_after()
  void offer_log(Message message, std::uint64_t last_number);
  /// @return the number after which lines are wanted; nullopt while older lines still wait.
  [[nodiscard]] std::optional<std::uint64_t> log_wanted_after() const;

  /// The next message to write; nullptr: none, or a write is pending.
  [[nodiscard]] Message next(Instant now);

  [[nodiscard]] ClientStatus status(Instant now) const {
    return FeedClient::status("live page", now);
  }

 private:
  std::array<Message, kTopics> waiting_{};
  std::uint64_t log_given_{0};
  std::string ticket_;
};

/// Messages of the live pages: frames at the page's rate; map and events when they change; clients,
/// log and tag residuals once a second. Encoded once for all pages, and only while there are pages.
/// No socket, no thread; time is passed in.
class LiveFeed final {
 public:
  LiveFeed(const WebConfig& config, const ProtocolContext& context);

  /// A new page, with hello, events, map, newest frame, clients and log waiting.
  [[nodiscard]] std::shared_ptr<LiveConnection> join(const net::Peer& peer, Instant now);
  void leave(const LiveConnection& connection);
  /// Another page gets the place of this address's newest one.
  void dismiss_newest_of(const net::Peer& address);

  void publish(const std::shared_ptr<const SceneFrame>& frame);
  /// Offers clients and log once a second, events twice a second.
  void tick(Instant now);

  [[nodiscard]] const std::vector<std::shared_ptr<LiveConnection>>& connections() const {
    return connections_;
  }
  /// JSON of `/api/v1/state`.
  [[nodiscard]] const Content& state(Instant now);
  [[nodiscard]] const Content& metrics(MetricsFormat format, Instant now);
  [[nodiscard]] Health health(Instant now) const;
  /// JSON of `/api/v1/map/versions`, and of the difference of two: nullopt while they are read.
  [[nodiscard]] const Content& versions(Instant now);
  [[nodiscard]] Expected<std::optional<Content>> diff(std::int64_t before, std::int64_t after);

 private:
  void offer_all(Topic topic, const Message& message);
  void publish_map(const SceneFrame& frame);
  void offer_log(LiveConnection& connection) const;
  void offer_events(Instant now);
  [[nodiscard]] Message hello() const;
  /// A literal; empty without an OperatorApi.
  [[nodiscard]] std::string_view map_mode() const;
  [[nodiscard]] Message map(const std::shared_ptr<const TagMap>& wanted);
  [[nodiscard]] Message clients() const;
  /// @return nullptr: no tag was seen within this time
  [[nodiscard]] Message fits(Duration within) const;
  [[nodiscard]] Message events() const;
  [[nodiscard]] std::vector<ClientStatus> all_clients() const;
  [[nodiscard]] std::string encode_state_now();
  [[nodiscard]] std::string encode_metrics_now(MetricsFormat format, Instant now) const;

  Duration frame_period_;
  ProtocolContext context_;
  std::shared_ptr<const SceneModel> model_;
  std::string_view sent_mode_;  ///< Map mode, as sent to the pages.
  std::shared_ptr<const SceneFrame> newest_;
  std::shared_ptr<const TagMap> sent_map_;
  std::optional<Instant> map_sent_at_;
  std::optional<Instant> next_frame_at_;
  std::optional<Instant> ticked_at_;
  std::optional<Instant> events_looked_at_;
  std::uint64_t sent_revision_{0};
  std::shared_ptr<const TagMap> encoded_map_;
  Message map_message_;  ///< Of `encoded_map_`.
  ClientTally tally_;
  Prepared state_;
  Prepared versions_;
  std::array<Prepared, 2> metrics_;  ///< By MetricsFormat.
  std::vector<std::shared_ptr<LiveConnection>> connections_;
};

}  // namespace fiducap::web
