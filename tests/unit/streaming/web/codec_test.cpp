#include "streaming/web/codec.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "support/allocation_counter.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::web {
namespace {

using Json = nlohmann::json;

// A message carries micrometres and 1e-6 of a quaternion.
constexpr double kWrittenDigits = 1e-6;

TEST(WebCodec, HelloNamesServerModeAndBodies) {
  const SceneModel model{3, {{1, "anymal"}, {7, "drone"}}};
  const auto hello = Json::parse(encode_hello({"hall", "0.1.0", "frozen", 20}, model));
  EXPECT_EQ(hello["type"], "hello");
  EXPECT_EQ(hello["server"], "hall");
  EXPECT_EQ(hello["version"], "0.1.0");
  EXPECT_EQ(hello["map_mode"], "frozen");
  EXPECT_EQ(hello["page_rate_hz"], 20);
  EXPECT_EQ(hello["bodies"], Json::parse(R"([{"id":1,"name":"anymal"},{"id":7,"name":"drone"}])"));
}

TEST(WebCodec, FrameCarriesPoseAndWhatIsKnownAboutIt) {
  const auto scene = make_scene_frame({"a", "b"}, 9);
  auto& body = scene->bodies[1];
  body.processing = std::chrono::microseconds(8400);
  body.images_dropped = 4;
  body.reprojection_px = 0.35;
  const auto frame = Json::parse(encode_frame(*scene));
  EXPECT_EQ(frame["number"], 9);
  EXPECT_EQ(frame["utc_ms"], scene->utc_ns() / 1'000'000);
  EXPECT_EQ(frame["rate_hz"], 100);
  const auto& sent = frame["bodies"][1];
  EXPECT_EQ(sent["id"], 2);
  EXPECT_EQ(sent["state"], "tracking");
  EXPECT_EQ(sent["valid"], true);
  EXPECT_EQ(sent["p"], Json::parse("[2.0,-2.0,0.5]"));
  EXPECT_NEAR(sent["q"][0].get<double>(), body.X_WP.q.w(), kWrittenDigits);
  EXPECT_NEAR(sent["q"][1].get<double>(), body.X_WP.q.x(), kWrittenDigits);
  EXPECT_NEAR(sent["q"][3].get<double>(), body.X_WP.q.z(), kWrittenDigits);
  EXPECT_EQ(sent["speed"], 0.573);  // |(0.5, -0.25, 0.125)|
  EXPECT_EQ(sent["sigma_mm"], 10);
  EXPECT_EQ(sent["sigma_deg"], 0.573);  // 10 mrad
  EXPECT_EQ(sent["age_ms"], 20);
  EXPECT_EQ(sent["latency_ms"], 8.4);
  EXPECT_EQ(sent["tags"], 3);
  EXPECT_EQ(sent["image_rate_hz"], 20);
  EXPECT_EQ(sent["reprojection_px"], 0.35);
  EXPECT_EQ(sent["images_dropped"], 4);
}

TEST(WebCodec, CovarianceIsTheUpperTriangleRowByRow) {
  const auto scene = make_scene_frame({"a"});
  auto& c = scene->bodies[0].covariance;
  c.topLeftCorner<3, 3>() << 1, 2, 3, 2, 4, 5, 3, 5, 6;
  const auto frame = Json::parse(encode_frame(*scene));
  EXPECT_EQ(frame["bodies"][0]["cov"], Json::parse("[1.0,2.0,3.0,4.0,5.0,6.0]"));
}

TEST(WebCodec, BodyThatWasNeverPlacedHasNoPose) {
  const auto scene = make_scene_frame({"a"});
  scene->bodies[0] = BodyPose{};
  for (const BodyState state : {BodyState::kSearching, BodyState::kLost}) {
    scene->bodies[0].state = state;
    const auto body = Json::parse(encode_frame(*scene))["bodies"][0];
    for (const char* name : {"p", "q", "v", "speed", "sigma_mm", "sigma_deg", "cov", "age_ms"}) {
      EXPECT_TRUE(body.at(name).is_null()) << name;
    }
  }
}

TEST(WebCodec, BodyWithoutTagsKeepsItsLastPoseAndSaysThatItIsInvalid) {
  const auto scene = make_scene_frame({"a"});
  scene->bodies[0].valid = false;
  for (const BodyState state : {BodyState::kSearching, BodyState::kLost}) {
    scene->bodies[0].state = state;
    const auto body = Json::parse(encode_frame(*scene))["bodies"][0];
    EXPECT_EQ(body["valid"], false);
    EXPECT_EQ(body["state"], name_of(state));
    EXPECT_TRUE(body["p"].is_array());
  }
}

TEST(WebCodec, NumbersThatAreNotFiniteBecomeNull) {
  const auto scene = make_scene_frame({"a"});
  scene->bodies[0].X_WP.p.y() = std::numeric_limits<double>::quiet_NaN();
  scene->bodies[0].reprojection_px = std::numeric_limits<double>::infinity();
  const auto body = Json::parse(encode_frame(*scene))["bodies"][0];
  EXPECT_TRUE(body["p"][1].is_null());
  EXPECT_TRUE(body["reprojection_px"].is_null());
}

TEST(WebCodec, NameThatIsNotUtf8IsReplacedNotThrown) {
  const SceneModel model{1, {{1, "r\xff\xfe"}}};
  const auto hello = Json::parse(encode_hello({}, model));
  EXPECT_EQ(hello["bodies"][0]["name"], "r\xEF\xBF\xBD\xEF\xBF\xBD");
}

TEST(WebCodec, MapCarriesEveryTagWithItsState) {
  TagMap map;
  map.version = 12;
  map.reference_tag = 5;
  MapTag tag;
  tag.tag.tag_id = 5;
  tag.tag.edge_m = 0.16;
  tag.tag.X_WT.p = {1, 2, 3};
  tag.tag.covariance = Matrix6d::Identity() * 4e-6;
  tag.state = TagState::kSurveyed;
  tag.sightings = 77;
  map.tags.push_back(tag);
  const auto sent = Json::parse(encode_map(map));
  EXPECT_EQ(sent["version"], 12);
  EXPECT_EQ(sent["family"], "tag36h11");
  EXPECT_EQ(sent["reference_tag"], 5);
  EXPECT_EQ(sent["tags"][0]["id"], 5);
  EXPECT_EQ(sent["tags"][0]["edge_m"], 0.16);
  EXPECT_EQ(sent["tags"][0]["state"], "surveyed");
  EXPECT_EQ(sent["tags"][0]["p"], Json::parse("[1.0,2.0,3.0]"));
  EXPECT_EQ(sent["tags"][0]["q"], Json::parse("[1.0,0.0,0.0,0.0]"));
  EXPECT_EQ(sent["tags"][0]["sigma_mm"], 2);
  EXPECT_EQ(sent["tags"][0]["sightings"], 77);
}

TEST(WebCodec, FitsSayHowWellTagsAreSeenAndWhen) {
  const std::vector<TagFit> fits{{7, 0.31249, 12, instant_from_ns(2'000'000'000)}};
  const auto sent = Json::parse(encode_fits(fits, std::chrono::seconds(100)));
  EXPECT_EQ(sent["type"], "fits");
  EXPECT_EQ(sent["tags"][0], Json::parse(R"({"id": 7, "px": 0.312, "sightings": 12,
                                             "last_seen_utc_ms": 102000})"));
}

TEST(WebCodec, VersionsAreListedWithTheirComments) {
  const MapVersionInfo one{7, 3, 1'700'000'000'123'456'789, "hash", "before the \"move\"", 24};
  const auto sent = Json::parse(encode_versions(std::span(&one, 1)))["versions"][0];
  EXPECT_EQ(sent["version"], 7);
  EXPECT_EQ(sent["parent"], 3);
  EXPECT_EQ(sent["utc_ms"], 1'700'000'000'123);
  EXPECT_EQ(sent["tags"], 24);
  EXPECT_EQ(sent["comment"], "before the \"move\"");
}

TEST(WebCodec, ADiffSaysFromWhereToWhereInMillimetres) {
  TagMap before;
  before.version = 3;
  before.tags.resize(2);
  before.tags[0].tag.tag_id = 1;
  before.tags[1].tag.tag_id = 2;
  TagMap after = before;
  after.version = 7;
  after.tags[0].tag.X_WT.p = {0, 0.012, 0};
  after.tags.pop_back();
  const auto sent = Json::parse(encode_diff(before, after, {}));
  EXPECT_EQ(sent["before"], 3);
  EXPECT_EQ(sent["after"], 7);
  ASSERT_EQ(sent["changes"].size(), 2U);
  EXPECT_EQ(sent["changes"][0]["mm"], 12);
  EXPECT_EQ(sent["changes"][0]["from"], Json::parse("[0.0,0.0,0.0]"));
  EXPECT_EQ(sent["changes"][0]["to"], Json::parse("[0.0,0.012,0.0]"));
  EXPECT_EQ(sent["changes"][1]["kind"], "removed");
  EXPECT_TRUE(sent["changes"][1]["to"].is_null());
}

TEST(WebCodec, MapWithoutReferenceSaysNull) {
  EXPECT_TRUE(Json::parse(encode_map({}))["reference_tag"].is_null());
}

TEST(WebCodec, ClientsCarryTheirDropsAndTheirClocks) {
  const std::vector<ClientStatus> clients{{"vrpn", "10.0.0.2:4 udp", "z-up m", 100, 3, 1.5},
                                          {"native", "p", "d", 0, 0, 0, ClockOffset{-0.25, 0.001}}};
  const auto sent = Json::parse(encode_clients(clients));
  EXPECT_EQ(sent["clients"][0],
            Json::parse(R"({"protocol":"vrpn","peer":"10.0.0.2:4 udp","detail":"z-up m",
                                                "sent":100,"dropped":3,"connected_s":1.5,
                                                "clock_offset_s":null,"clock_sigma_s":null})"));
  EXPECT_EQ(sent["clients"][1]["clock_offset_s"], -0.25);
  EXPECT_EQ(sent["clients"][1]["clock_sigma_s"], 0.001);
}

TEST(WebCodec, LongLogTextIsCut) {
  const std::vector<log::Line> lines{
      {4, 1700, log::Level::kWarning, "vrpn", std::string(5000, 'x')}};
  const auto sent = Json::parse(encode_log(lines));
  EXPECT_EQ(sent["lines"][0]["n"], 4);
  EXPECT_EQ(sent["lines"][0]["level"], "warning");
  EXPECT_EQ(sent["lines"][0]["text"].get<std::string>().size(), 1000);
}

TEST(WebCodec, StateJoinsTheMessagesAndSaysNullForWhatIsMissing) {
  const auto state =
      Json::parse(encode_state({R"({"type":"hello"})", "", "", "", R"({"clients":[]})", "", ""}));
  EXPECT_EQ(state["hello"]["type"], "hello");
  EXPECT_TRUE(state["map"].is_null());
  EXPECT_TRUE(state["frame"].is_null());
  EXPECT_TRUE(state["clients"]["clients"].empty());
}

TEST(WebCodec, EventsAreWhatHoldsAndWhatHappened) {
  const std::vector<Event> standing{{.number = 4,
                                     .utc_ms = 1000,
                                     .severity = Severity::kWarning,
                                     .subject = "drone",
                                     .kind = "coasting",
                                     .text = "sees no tag",
                                     .remedy = "Look at the camera"}};
  const std::vector<Event> newest{
      {.number = 5, .subject = "map", .kind = "x", .text = "saved", .over = true}};
  const auto events = Json::parse(encode_events(standing, newest));
  EXPECT_EQ(events["type"], "events");
  EXPECT_EQ(events["standing"][0],
            Json::parse(R"({"n":4,"utc_ms":1000,"severity":"warning","subject":"drone",
                            "kind":"coasting","text":"sees no tag",
                            "remedy":"Look at the camera","over":false})"));
  EXPECT_EQ(events["events"][0]["severity"], "info");
  EXPECT_EQ(events["events"][0]["over"], true);
}

TEST(WebCodec, AnEventThatIsNoTextIsSentAllTheSame) {
  const std::vector<Event> hostile{
      {.subject = "drone", .kind = "x", .text = "\xff\"\n" + std::string(5000, 'x')}};
  const auto events = Json::parse(encode_events(hostile, {}));
  EXPECT_LE(events["standing"][0]["text"].get<std::string>().size(), 1002u);
}

TEST(WebCodec, MemoryThatIsOutIsAnExceptionWhereverItIsAskedFor) {
  const auto scene = make_scene_frame({"a", "b"}, 9);
  AllocationFault::reach_this_thread();
  bool has_failed = true;
  int tried = 0;
  for (; has_failed; ++tried) {
    AllocationFault::arm(tried + 1);
    std::string frame;
    try {
      frame = encode_frame(*scene);
    } catch (const std::bad_alloc&) {
    }
    has_failed = AllocationFault::disarm();
    EXPECT_EQ(frame.empty(), has_failed);
  }
  EXPECT_GT(tried, 3);
}

TEST(WebCodec, NamesThatAreNoUtf8AreReplaced) {
  const SceneModel model{3, {{1, "an\xffy\"mal\n"}}};
  const auto hello = Json::parse(encode_hello({"hall", "0.1.0", "frozen", 20}, model));
  EXPECT_EQ(hello["bodies"][0]["name"], "an\uFFFDy\"mal\n");
}

}  // namespace
}  // namespace fiducap::web
