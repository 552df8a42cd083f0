#include "streaming/web/live_feed.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::json;

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
  std::shared_ptr<TagMap> map_ = std::make_shared<TagMap>();
  std::shared_ptr<SceneModel> model_ = std::make_shared<SceneModel>();
  LiveFeed feed_{config(), sources(), model_};
};

TEST_F(LiveFeedTest, PagesHearThatTheMapWasFrozen) {
  feed_.publish(frame_at(0ms));
  const auto page = feed_.join("peer", start_);
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
  const auto page = feed_.join("peer", start_);
  EXPECT_EQ(types(*page), (std::vector<std::string>{"hello", "map", "frame", "clients", "log"}));
}

TEST_F(LiveFeedTest, PageOfAFreshServerGetsHelloBeforeAnyFrame) {
  const auto page = feed_.join("peer", start_);
  EXPECT_EQ(types(*page).front(), "hello");
}

TEST_F(LiveFeedTest, HundredFramesASecondBecomeTwenty) {
  const auto page = feed_.join("peer", start_);
  for (int i = 0; i < 100; ++i) {
    feed_.publish(frame_at(i * 10ms));
    drain(*page);
  }
  EXPECT_EQ(page->status(start_).frames_sent, 20);
  EXPECT_EQ(page->status(start_).frames_dropped, 0);
}

TEST_F(LiveFeedTest, JitterOfThePublisherDoesNotHalveTheRate) {
  const auto page = feed_.join("peer", start_);
  for (int i = 0; i < 20; ++i) {
    feed_.publish(frame_at(i * 50ms + (i % 2 == 0 ? 1ms : -1ms)));
    drain(*page);
  }
  EXPECT_EQ(page->status(start_).frames_sent, 20);
}

TEST_F(LiveFeedTest, AfterAPauseFramesDoNotComeInABurst) {
  const auto page = feed_.join("peer", start_);
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
  const auto page = feed_.join("peer", start_);
  drain(*page);
  feed_.publish(frame_at(1s));
  EXPECT_EQ(types(*page), std::vector<std::string>{"frame"});
  map_ = std::make_shared<TagMap>();
  feed_.publish(frame_at(2s));
  EXPECT_EQ(types(*page), (std::vector<std::string>{"map", "frame"}));
}

TEST_F(LiveFeedTest, MapThatChangesWithEveryFrameGoesOutTwiceASecondAndEndsUpNewest) {
  const auto page = feed_.join("peer", start_);
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
  const auto page = feed_.join("peer", start_);
  drain(*page);
  const auto frame = frame_at(0ms);
  frame->model = std::make_shared<SceneModel>(SceneModel{2, {{4, "newcomer"}}});
  feed_.publish(frame);
  const auto hello = Json::parse(*page->next(start_));
  EXPECT_EQ(hello["type"], "hello");
  EXPECT_EQ(hello["bodies"][0]["name"], "newcomer");
}

TEST_F(LiveFeedTest, ClientsAndNewLogLinesComeOnceASecond) {
  const auto page = feed_.join("peer", start_);
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

TEST_F(LiveFeedTest, StateIsOneJsonObjectWithAndWithoutFrames) {
  EXPECT_TRUE(Json::parse(feed_.state())["frame"].is_null());
  feed_.publish(frame_at(0ms));
  const auto state = Json::parse(feed_.state());
  EXPECT_EQ(state["frame"]["number"], 1);
  EXPECT_EQ(state["hello"]["server"], "hall");
  EXPECT_EQ(state["clients"]["clients"][0]["protocol"], "vrpn");
}

TEST_F(LiveFeedTest, TroubleIsNamedWhenFramesStop) {
  EXPECT_EQ(feed_.trouble(start_), "no frame was published yet");
  feed_.publish(frame_at(0ms));
  EXPECT_EQ(feed_.trouble(start_ + 1s), "");
  EXPECT_EQ(feed_.trouble(start_ + 3s), "frames stopped");
}

TEST_F(LiveFeedTest, PageThatLeftIsForgotten) {
  const auto page = feed_.join("peer", start_);
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
