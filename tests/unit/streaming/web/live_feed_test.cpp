#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>
#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "streaming/web/live_feed.hpp"
#include "support/fake_clock.hpp"
#include "support/fake_operator_api.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;

using Json = nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Message text(const char* content) { return std::make_shared<const std::string>(content); }

class LiveConnectionTest : public testing::Test {
 protected:
  std::string take() {
    const Message message = connection_.next(now_);
    if (!message) return "";
    connection_.written();
    return *message;
  }

  Instant now_ = instant_from_ns(1'000);
  LiveConnection connection_{net::Peer{0x7f000001, 5}, now_};
};

TEST_F(LiveConnectionTest, SendsHelloFirst) {
  connection_.offer_log(text("log"), 3);
  connection_.offer(Topic::kClients, text("clients"));
  connection_.offer(Topic::kFrame, text("frame"));
  connection_.offer(Topic::kMap, text("map"));
  connection_.offer(Topic::kHello, text("hello"));
  for (const char* expected : {"hello", "map", "frame", "clients", "log", ""})
    EXPECT_EQ(take(), expected);
}

TEST_F(LiveConnectionTest, SendsTheNewestFrameAndCountsTheDropped) {
  for (const char* frame : {"1", "2", "3"}) connection_.offer(Topic::kFrame, text(frame));
  EXPECT_EQ(take(), "3");
  EXPECT_EQ(take(), "");
  EXPECT_EQ(connection_.status(now_).frames_sent, 1);
  EXPECT_EQ(connection_.status(now_).frames_dropped, 2);
}

TEST_F(LiveConnectionTest, SendsOneMessageAtATime) {
  connection_.offer(Topic::kHello, text("hello"));
  connection_.offer(Topic::kFrame, text("frame"));
  ASSERT_NE(connection_.next(now_), nullptr);
  EXPECT_EQ(connection_.next(now_), nullptr);
  connection_.written();
  EXPECT_EQ(take(), "frame");
}

TEST_F(LiveConnectionTest, KeepsWaitingLogLines) {
  EXPECT_EQ(connection_.log_wanted_after(), 0);
  connection_.offer_log(text("lines"), 17);
  EXPECT_EQ(connection_.log_wanted_after(), std::nullopt);
  EXPECT_EQ(take(), "lines");
  EXPECT_EQ(connection_.log_wanted_after(), 17);
}

TEST_F(LiveConnectionTest, IsStuckWhileAWriteTakesTooLong) {
  EXPECT_FALSE(connection_.is_stuck(now_ + 1h, 5s));
  connection_.offer(Topic::kFrame, text("frame"));
  ASSERT_NE(connection_.next(now_), nullptr);
  EXPECT_FALSE(connection_.is_stuck(now_ + 5s, 5s));
  EXPECT_TRUE(connection_.is_stuck(now_ + 6s, 5s));
  connection_.written();
  EXPECT_FALSE(connection_.is_stuck(now_ + 6s, 5s));
}

TEST_F(LiveConnectionTest, StatusHasPeerAndTimeConnected) {
  const auto status = connection_.status(now_ + 2500ms);
  EXPECT_EQ(status.protocol, "web");
  EXPECT_EQ(status.peer, "127.0.0.1:5 tcp");
  EXPECT_EQ(status.connected_s, 2.5);
}

constexpr net::Peer kPeer{0x0a000001, 5};

class LiveFeedTest : public testing::Test {
 protected:
  static WebConfig config() {
    WebConfig made;
    made.rate_hz = 20;
    return made;
  }
  struct Operator final : FakeOperatorApi {
    std::vector<TagFit> fits;
    [[nodiscard]] std::vector<TagFit> tag_fits() const override { return fits; }
  };
  ProtocolContext context() {
    ProtocolContext made{io_, std::make_shared<SceneModel>(), clock_, &operator_, &events_};
    made.clients = [] { return std::vector<ClientStatus>{{"vrpn", "peer", "", 5, 0, 1}}; };
    return made;
  }
  std::shared_ptr<SceneFrame> frame_at(Duration since_start) {
    auto frame = make_scene_frame({"a"}, ++number_);
    frame->at = frame->published_at = start_ + since_start;
    frame->map = map_;
    return frame;
  }
  void publish(Duration since_start) { feed_.publish(frame_at(since_start)); }
  void tick(Duration since_start) { feed_.tick(start_ + since_start); }
  std::shared_ptr<LiveConnection> join() { return feed_.join(kPeer, start_); }
  /// All waiting messages.
  static std::vector<Json> sent(LiveConnection& connection) {
    std::vector<Json> all;
    while (const auto message = connection.next(instant_from_ns(0))) {
      connection.written();
      all.push_back(Json::parse(*message));
    }
    return all;
  }
  static std::vector<std::string> types(LiveConnection& connection) {
    std::vector<std::string> all;
    for (const auto& message : sent(connection)) all.push_back(message["type"]);
    return all;
  }
  /// A page that has received everything of before.
  std::shared_ptr<LiveConnection> join_and_drain() {
    auto page = join();
    (void)sent(*page);
    return page;
  }
  /// @return frames that a page gets when they are published at these times
  std::uint64_t frames_sent(const std::vector<Duration>& times) {
    LiveFeed feed(config(), context());
    const auto page = feed.join(kPeer, start_);
    for (const Duration at : times) {
      feed.publish(frame_at(at));
      (void)sent(*page);
    }
    EXPECT_EQ(page->status(start_).frames_dropped, 0);
    return page->status(start_).frames_sent;
  }

  Instant start_ = instant_from_ns(1'000'000'000);
  std::uint64_t number_{0};
  boost::asio::io_context io_;
  FakeClock clock_;
  Operator operator_;
  EventBoard events_{[] { return std::int64_t{5'000'000}; }};
  std::shared_ptr<TagMap> map_ = std::make_shared<TagMap>();
  LiveFeed feed_{config(), context()};
};

TEST_F(LiveFeedTest, ReportsChangesOfTheMapMode) {
  publish(0ms);
  const auto page = join_and_drain();
  operator_.mode = MapMode::kMapping;
  tick(1s);
  EXPECT_EQ(sent(*page).at(0)["map_mode"], "mapping");
}

TEST_F(LiveFeedTest, NewPageGetsHelloThenAllOtherMessages) {
  EXPECT_EQ(types(*join()).front(), "hello") << "without a frame";
  log::info("test", "a line for the page");
  publish(0ms);
  EXPECT_THAT(types(*join()), ElementsAre("hello", "events", "map", "frame", "clients", "log"));
}

TEST_F(LiveFeedTest, SendsFitsOfRecentTagsOnceASecond) {
  operator_.fits = {{4, 0.3, 9, start_}, {7, 0.3, 9, start_}};
  const auto publish_and_tick = [this](Duration at) {
    publish(at);
    tick(at);
  };
  publish_and_tick(0ms);
  const auto page = join();
  const auto sent_tags = [&] {
    std::vector<int> ids;
    for (const auto& message : sent(*page)) {
      if (message["type"] != "fits") continue;
      for (const auto& tag : message["tags"]) ids.push_back(tag["id"]);
    }
    return ids;
  };
  EXPECT_THAT(sent_tags(), ElementsAre(4, 7)) << "all, at first";
  operator_.fits[1].seen_at = start_ + 8s;
  publish_and_tick(9s);
  EXPECT_THAT(sent_tags(), ElementsAre(7));
  publish_and_tick(9500ms);
  publish_and_tick(20s);
  EXPECT_THAT(sent_tags(), IsEmpty());
}

TEST_F(LiveFeedTest, SendsFramesAtTheConfiguredRate) {
  std::vector<Duration> at_100_hz;
  std::vector<Duration> at_20_hz_with_jitter;
  std::vector<Duration> with_a_pause{0ms};
  for (int i = 0; i < 100; ++i) at_100_hz.push_back(i * 10ms);
  for (int i = 0; i < 20; ++i) at_20_hz_with_jitter.push_back(i * 50ms + (i % 2 == 0 ? 1ms : -1ms));
  for (int i = 0; i < 10; ++i) with_a_pause.push_back(10s + i * 10ms);
  EXPECT_EQ(frames_sent(at_100_hz), 20);
  EXPECT_EQ(frames_sent(at_20_hz_with_jitter), 20);
  EXPECT_EQ(frames_sent(with_a_pause), 3) << "0 s, 10.00 s, 10.05 s";
}

TEST_F(LiveFeedTest, SendsTheMapWhenItChanges) {
  publish(0ms);
  const auto page = join_and_drain();
  publish(1s);
  EXPECT_THAT(types(*page), ElementsAre("frame"));
  map_ = std::make_shared<TagMap>();
  publish(2s);
  EXPECT_THAT(types(*page), ElementsAre("map", "frame"));
}

TEST_F(LiveFeedTest, SendsAChangingMapTwiceASecondAndTheNewestInTheEnd) {
  const auto page = join_and_drain();
  std::vector<std::int64_t> versions;
  const auto publish_map = [&](std::int64_t version, Duration at) {
    if (map_->version != version) map_ = std::make_shared<TagMap>();
    map_->version = version;
    publish(at);
    for (const auto& message : sent(*page))
      if (message["type"] == "map") versions.push_back(message["version"]);
  };
  for (int i = 0; i < 100; ++i) publish_map(i, i * 10ms);
  ASSERT_EQ(versions.size(), 2u);
  publish_map(99, 1001ms);
  EXPECT_EQ(versions.back(), 99);
}

TEST_F(LiveFeedTest, SendsHelloForChangedBodies) {
  const auto page = join_and_drain();
  const auto frame = frame_at(0ms);
  frame->model = std::make_shared<SceneModel>(SceneModel{2, {{4, "newcomer"}}});
  feed_.publish(frame);
  const Json hello = sent(*page).at(0);
  EXPECT_EQ(hello["type"], "hello");
  EXPECT_EQ(hello["bodies"][0]["name"], "newcomer");
}

TEST_F(LiveFeedTest, SendsClientsAndNewLogLinesOnceASecond) {
  const auto page = join();
  tick(0ms);
  (void)sent(*page);
  log::info("test", "a new line");
  tick(900ms);
  EXPECT_THAT(types(*page), IsEmpty());
  tick(1s);
  EXPECT_THAT(types(*page), ElementsAre("clients", "log"));
  tick(2s);
  EXPECT_THAT(types(*page), ElementsAre("clients"));
}

TEST_F(LiveFeedTest, SendsChangedEventsAtMostTwiceASecond) {
  tick(0ms);
  const auto page = join_and_drain();
  events_.begin({.severity = Severity::kError, .subject = "drone", .kind = "lost", .text = "why"});
  tick(400ms);
  EXPECT_THAT(types(*page), IsEmpty());
  tick(500ms);
  const Json begun = sent(*page).at(0);
  EXPECT_EQ(begun["type"], "events");
  EXPECT_EQ(begun["standing"][0]["subject"], "drone");
  events_.end("drone", "lost", "it is back");
  tick(990ms);
  EXPECT_THAT(types(*page), IsEmpty());
  tick(1000ms);
  const Json over = sent(*page).at(0);
  EXPECT_TRUE(over["standing"].empty());
  EXPECT_EQ(over["events"].size(), 2);
  tick(1900ms);
  EXPECT_THAT(types(*page), IsEmpty()) << "nothing has changed";
}

TEST_F(LiveFeedTest, StateIsMadeOncePerPeriod) {
  const auto first = feed_.state(start_).plain;
  EXPECT_TRUE(Json::parse(*first)["frame"].is_null());
  publish(0ms);
  events_.report({.subject = "map", .kind = "saved", .text = "version 2"});
  EXPECT_EQ(feed_.state(start_ + Prepared::kPeriod - 1ms).plain, first);
  const auto state = Json::parse(*feed_.state(start_ + Prepared::kPeriod).plain);
  EXPECT_EQ(state["frame"]["number"], 1);
  EXPECT_EQ(state["hello"]["map_mode"], "frozen");
  EXPECT_EQ(state["clients"]["clients"][0]["protocol"], "vrpn");
  EXPECT_EQ(state["events"]["events"][0]["text"], "version 2");
}

TEST_F(LiveFeedTest, MetricsAreMadeOncePerPeriodAndFormat) {
  const auto metrics = [this](Duration at, MetricsFormat format = MetricsFormat::kPrometheus) {
    return feed_.metrics(format, start_ + at).plain;
  };
  const auto first = metrics(0ms);
  EXPECT_EQ(metrics(0ms), first);
  EXPECT_NE(metrics(0ms, MetricsFormat::kOpenMetrics), first);
  EXPECT_THAT(*first, HasSubstr("fiducap_healthy 0\n"));
  publish(0ms);
  EXPECT_THAT(*metrics(Prepared::kPeriod), HasSubstr("fiducap_healthy 1\n"));
}

TEST_F(LiveFeedTest, HealthHasTheReasonWhenFramesStop) {
  EXPECT_EQ(feed_.health(start_).trouble, "no frame was published yet");
  publish(0ms);
  EXPECT_EQ(feed_.health(start_ + 1s).trouble, "");
  EXPECT_EQ(feed_.health(start_ + 3s).trouble, "frames stopped");
}

TEST_F(LiveFeedTest, HealthCountsCurrentAlarms) {
  events_.begin({.severity = Severity::kWarning, .subject = "clock", .kind = "x", .text = "why"});
  events_.begin({.severity = Severity::kError, .subject = "drone", .kind = "lost", .text = "why"});
  events_.report({.severity = Severity::kError, .subject = "map", .kind = "x", .text = "why"});
  EXPECT_THAT(feed_.health(start_).alarms, ElementsAre(0u, 1u, 1u));
}

TEST(WebConfig, ReportsEachInvalidValue) {
  EXPECT_TRUE(WebConfig{}.check().empty());
  WebConfig config;
  config.address = "";
  config.rate_hz = 0;
  config.max_clients = 0;
  EXPECT_EQ(config.check().size(), 3);
}

}  // namespace
}  // namespace fiducap::web
