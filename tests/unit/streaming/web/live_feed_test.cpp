#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "streaming/web/live_feed.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;

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

TEST_F(LiveConnectionTest, HelloLeavesFirstWhateverCameFirst) {
  connection_.offer_log(text("log"), 3);
  connection_.offer(Topic::kClients, text("clients"));
  connection_.offer(Topic::kFrame, text("frame"));
  connection_.offer(Topic::kMap, text("map"));
  connection_.offer(Topic::kHello, text("hello"));
  for (const char* expected : {"hello", "map", "frame", "clients", "log", ""})
    EXPECT_EQ(take(), expected);
}

TEST_F(LiveConnectionTest, NewestFrameWinsAndTheOlderOneIsCounted) {
  connection_.offer(Topic::kFrame, text("1"));
  connection_.offer(Topic::kFrame, text("2"));
  connection_.offer(Topic::kFrame, text("3"));
  EXPECT_EQ(take(), "3");
  EXPECT_EQ(take(), "");
  EXPECT_EQ(connection_.status(now_).frames_sent, 1);
  EXPECT_EQ(connection_.status(now_).frames_dropped, 2);
}

TEST_F(LiveConnectionTest, OneMessageIsUnderWayAtATime) {
  connection_.offer(Topic::kHello, text("hello"));
  connection_.offer(Topic::kFrame, text("frame"));
  ASSERT_NE(connection_.next(now_), nullptr);
  EXPECT_EQ(connection_.next(now_), nullptr);
  connection_.written();
  EXPECT_EQ(take(), "frame");
}

TEST_F(LiveConnectionTest, WaitingLogLinesAreNeverReplaced) {
  EXPECT_EQ(connection_.log_wanted_after(), 0);
  connection_.offer_log(text("lines"), 17);
  EXPECT_EQ(connection_.log_wanted_after(), std::nullopt);
  EXPECT_EQ(take(), "lines");
  EXPECT_EQ(connection_.log_wanted_after(), 17);
}

TEST_F(LiveConnectionTest, IsStuckOnlyWhileOneWriteTakesTooLong) {
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

using namespace std::chrono_literals;
using Json = nlohmann::json;

constexpr net::Peer kPeer{0x0a000001, 5};

class LiveFeedTest : public testing::Test {
 protected:
  static WebConfig config() {
    WebConfig made;
    made.rate_hz = 20;
    return made;
  }
  WebSources sources() {
    WebSources made;
    made.map_mode = [this] { return map_mode_; };
    made.events = &events_;
    made.server_name = "hall";
    made.clients = [] { return std::vector<ClientStatus>{{"vrpn", "peer", "", 5, 0, 1}}; };
    return made;
  }
  std::shared_ptr<SceneFrame> frame_at(Duration since_start) {
    auto frame = make_scene_frame({"a"}, ++number_);
    frame->published_at = start_ + since_start;
    frame->map = map_;
    return frame;
  }
  static void drain(LiveConnection& connection) {
    while (connection.next(instant_from_ns(0))) connection.written();
  }
  // The types of everything that waits, oldest rules of order applied.
  static std::vector<std::string> types(LiveConnection& connection) {
    std::vector<std::string> all;
    while (const auto message = connection.next(instant_from_ns(0))) {
      connection.written();
      all.push_back(Json::parse(*message)["type"]);
    }
    return all;
  }

  Instant start_ = instant_from_ns(1'000'000'000);
  std::uint64_t number_{0};
  std::string map_mode_{"mapping"};
  EventBoard events_{[] { return std::int64_t{5'000'000}; }};
  std::shared_ptr<TagMap> map_ = std::make_shared<TagMap>();
  std::shared_ptr<SceneModel> model_ = std::make_shared<SceneModel>();
  LiveFeed feed_{config(), sources(), model_};
};

TEST_F(LiveFeedTest, PagesHearThatTheMapWasFrozen) {
  feed_.publish(frame_at(0ms));
  const auto page = feed_.join(kPeer, start_);
  drain(*page);
  map_mode_ = "frozen";
  feed_.tick(start_ + 1s);
  const auto message = page->next(instant_from_ns(0));
  ASSERT_TRUE(message);
  EXPECT_EQ(Json::parse(*message)["map_mode"], "frozen");
}

TEST_F(LiveFeedTest, NewPageGetsEverythingAtOnce) {
  log::info("test", "a line for the page");
  feed_.publish(frame_at(0ms));
  const auto page = feed_.join(kPeer, start_);
  EXPECT_EQ(types(*page),
            (std::vector<std::string>{"hello", "events", "map", "frame", "clients", "log"}));
}

TEST_F(LiveFeedTest, HowWellTagsAreSeenComesOnceASecondOfThoseJustSeen) {
  std::vector<TagFit> fits{{4, 0.3, 9, start_}, {7, 0.3, 9, start_}};
  auto sources_of_tags = sources();
  sources_of_tags.tag_fits = [&] { return fits; };
  LiveFeed feed(config(), sources_of_tags, model_);
  const auto publish = [&](Duration since_start) {
    auto frame = frame_at(since_start);
    frame->at = start_ + since_start;
    feed.publish(frame);
    feed.tick(start_ + since_start);
  };
  publish(0ms);
  const auto page = feed.join(kPeer, start_);
  const auto sent_tags = [&] {
    std::vector<int> ids;
    while (const auto message = page->next(start_)) {
      page->written();
      const auto json = Json::parse(*message);
      if (json["type"] == "fits")
        for (const auto& tag : json["tags"]) ids.push_back(tag["id"]);
    }
    return ids;
  };
  EXPECT_EQ(sent_tags(), (std::vector{4, 7})) << "all, at first";
  fits[1].seen_at = start_ + 8s;
  publish(9s);
  EXPECT_EQ(sent_tags(), (std::vector{7}));
  publish(9500ms);
  publish(20s);
  EXPECT_TRUE(sent_tags().empty());
}

TEST_F(LiveFeedTest, PageOfAFreshServerGetsHelloBeforeAnyFrame) {
  const auto page = feed_.join(kPeer, start_);
  EXPECT_EQ(types(*page).front(), "hello");
}

TEST_F(LiveFeedTest, HundredFramesASecondBecomeTwenty) {
  const auto page = feed_.join(kPeer, start_);
  for (int i = 0; i < 100; ++i) {
    feed_.publish(frame_at(i * 10ms));
    drain(*page);
  }
  EXPECT_EQ(page->status(start_).frames_sent, 20);
  EXPECT_EQ(page->status(start_).frames_dropped, 0);
}

TEST_F(LiveFeedTest, JitterOfThePublisherDoesNotHalveTheRate) {
  const auto page = feed_.join(kPeer, start_);
  for (int i = 0; i < 20; ++i) {
    feed_.publish(frame_at(i * 50ms + (i % 2 == 0 ? 1ms : -1ms)));
    drain(*page);
  }
  EXPECT_EQ(page->status(start_).frames_sent, 20);
}

TEST_F(LiveFeedTest, AfterAPauseFramesDoNotComeInABurst) {
  const auto page = feed_.join(kPeer, start_);
  feed_.publish(frame_at(0ms));
  drain(*page);
  for (int i = 0; i < 10; ++i) {
    feed_.publish(frame_at(10s + i * 10ms));
    drain(*page);
  }
  EXPECT_EQ(page->status(start_).frames_sent, 3);  // 0 s, 10.00 s, 10.05 s
}

TEST_F(LiveFeedTest, MapGoesOutWhenItChangesAndNotOtherwise) {
  feed_.publish(frame_at(0ms));
  const auto page = feed_.join(kPeer, start_);
  drain(*page);
  feed_.publish(frame_at(1s));
  EXPECT_EQ(types(*page), std::vector<std::string>{"frame"});
  map_ = std::make_shared<TagMap>();
  feed_.publish(frame_at(2s));
  EXPECT_EQ(types(*page), (std::vector<std::string>{"map", "frame"}));
}

TEST_F(LiveFeedTest, MapThatChangesWithEveryFrameGoesOutTwiceASecondAndEndsUpNewest) {
  const auto page = feed_.join(kPeer, start_);
  drain(*page);
  int maps = 0;
  std::int64_t newest = 0;
  const auto look = [&](Duration at) {
    feed_.publish(frame_at(at));
    while (const auto message = page->next(start_)) {
      page->written();
      const auto json = Json::parse(*message);
      if (json["type"] != "map") continue;
      ++maps;
      newest = json["version"];
    }
  };
  for (int i = 0; i < 100; ++i) {
    map_ = std::make_shared<TagMap>();
    map_->version = i;
    look(i * 10ms);
  }
  EXPECT_EQ(maps, 2);
  look(1001ms);
  EXPECT_EQ(newest, 99);
}

TEST_F(LiveFeedTest, NewListOfBodiesIsAnnounced) {
  const auto page = feed_.join(kPeer, start_);
  drain(*page);
  const auto frame = frame_at(0ms);
  frame->model = std::make_shared<SceneModel>(SceneModel{2, {{4, "newcomer"}}});
  feed_.publish(frame);
  const auto hello = Json::parse(*page->next(start_));
  EXPECT_EQ(hello["type"], "hello");
  EXPECT_EQ(hello["bodies"][0]["name"], "newcomer");
}

TEST_F(LiveFeedTest, ClientsAndNewLogLinesComeOnceASecond) {
  const auto page = feed_.join(kPeer, start_);
  feed_.tick(start_);
  drain(*page);
  log::info("test", "news");
  feed_.tick(start_ + 900ms);
  EXPECT_TRUE(types(*page).empty());
  feed_.tick(start_ + 1s);
  EXPECT_EQ(types(*page), (std::vector<std::string>{"clients", "log"}));
  feed_.tick(start_ + 2s);
  EXPECT_EQ(types(*page), std::vector<std::string>{"clients"});
}

TEST_F(LiveFeedTest, EventsComeWhenTheyChangeAtMostTwiceASecond) {
  feed_.tick(start_);
  const auto page = feed_.join(kPeer, start_);
  drain(*page);
  events_.begin({.severity = Severity::kError, .subject = "drone", .kind = "lost", .text = "why"});
  feed_.tick(start_ + 400ms);
  EXPECT_TRUE(types(*page).empty());
  feed_.tick(start_ + 500ms);
  const auto json = Json::parse(*page->next(start_));
  page->written();
  EXPECT_EQ(json["type"], "events");
  EXPECT_EQ(json["standing"][0]["subject"], "drone");
  events_.end("drone", "lost", "it is back");
  feed_.tick(start_ + 990ms);
  EXPECT_TRUE(types(*page).empty());
  feed_.tick(start_ + 1000ms);
  const auto over = Json::parse(*page->next(start_));
  page->written();
  EXPECT_TRUE(over["standing"].empty());
  EXPECT_EQ(over["events"].size(), 2);
  drain(*page);
  feed_.tick(start_ + 1900ms);
  EXPECT_TRUE(types(*page).empty()) << "nothing has changed";
}

TEST_F(LiveFeedTest, StateIsOneJsonObjectWithAndWithoutFrames) {
  EXPECT_TRUE(Json::parse(*feed_.state(start_).plain)["frame"].is_null());
  feed_.publish(frame_at(0ms));
  events_.report({.subject = "map", .kind = "saved", .text = "version 2"});
  const auto state = Json::parse(*feed_.state(start_ + Prepared::kPeriod).plain);
  EXPECT_EQ(state["frame"]["number"], 1);
  EXPECT_EQ(state["hello"]["server"], "hall");
  EXPECT_EQ(state["clients"]["clients"][0]["protocol"], "vrpn");
  EXPECT_EQ(state["events"]["events"][0]["text"], "version 2");
}

TEST_F(LiveFeedTest, StateIsMadeOncePerPeriodHoweverManyAsk) {
  feed_.publish(frame_at(0ms));
  const auto first = feed_.state(start_).plain;
  feed_.publish(frame_at(10ms));
  EXPECT_EQ(feed_.state(start_ + Prepared::kPeriod - 1ms).plain, first);
  const auto later = Json::parse(*feed_.state(start_ + Prepared::kPeriod).plain);
  EXPECT_EQ(later["frame"]["number"], 2);
}

TEST_F(LiveFeedTest, MetricsAreMadeOncePerPeriodInEachFormat) {
  const auto first = feed_.metrics(MetricsFormat::kPrometheus, start_).plain;
  EXPECT_EQ(feed_.metrics(MetricsFormat::kPrometheus, start_).plain, first);
  EXPECT_NE(feed_.metrics(MetricsFormat::kOpenMetrics, start_).plain, first);
  EXPECT_NE(first->find("fiducap_healthy 0\n"), std::string::npos);
  feed_.publish(frame_at(0ms));
  const auto later = feed_.metrics(MetricsFormat::kPrometheus, start_ + Prepared::kPeriod).plain;
  EXPECT_NE(later->find("fiducap_healthy 1\n"), std::string::npos);
}

TEST_F(LiveFeedTest, TroubleIsNamedWhenFramesStop) {
  EXPECT_EQ(feed_.health(start_).trouble, "no frame was published yet");
  feed_.publish(frame_at(0ms));
  EXPECT_EQ(feed_.health(start_ + 1s).trouble, "");
  EXPECT_EQ(feed_.health(start_ + 3s).trouble, "frames stopped");
}

TEST_F(LiveFeedTest, HealthCountsStandingAlarms) {
  events_.begin({.severity = Severity::kWarning,
                 .subject = "clock",
                 .kind = "unsynchronised",
                 .text = "why"});
  events_.begin({.severity = Severity::kError, .subject = "drone", .kind = "lost", .text = "why"});
  events_.report(
      {.severity = Severity::kError, .subject = "map", .kind = "refused", .text = "why"});
  EXPECT_EQ(feed_.health(start_).alarms, (std::array<std::size_t, 3>{0, 1, 1}));
}

TEST_F(LiveFeedTest, TheNewestPageOfAnAddressIsTheOneThatGoes) {
  const auto first = feed_.join(kPeer, start_);
  const auto second = feed_.join(kPeer.with_port(6), start_);
  const auto other = feed_.join({0x0a000002, 5}, start_);
  feed_.dismiss_newest_of(kPeer);
  EXPECT_TRUE(second->dismissed());
  EXPECT_FALSE(first->dismissed());
  EXPECT_FALSE(other->dismissed());
  EXPECT_EQ(feed_.connections().size(), 2u);
}

TEST_F(LiveFeedTest, PageThatLeftIsForgotten) {
  const auto page = feed_.join(kPeer, start_);
  feed_.leave(*page);
  EXPECT_TRUE(feed_.connections().empty());
}

TEST(WebConfig, DefaultsAreUsableAndEveryBrokenRuleIsNamed) {
  EXPECT_TRUE(WebConfig{}.check().empty());
  WebConfig config;
  config.address = "";
  config.rate_hz = 0;
  config.max_clients = 0;
  EXPECT_EQ(config.check().size(), 3);
}

}  // namespace
}  // namespace fiducap::web
