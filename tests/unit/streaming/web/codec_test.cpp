#include "streaming/web/codec.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "expect_members.hpp"
#include "support/allocation_counter.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::web {
namespace {

using Json = nlohmann::json;

// A message carries micrometres and 1e-6 of a quaternion.
constexpr double kWrittenDigits = 1e-6;

Json encoded(const SceneFrame& frame) { return Json::parse(encode_frame(frame)); }

TEST(WebCodec, HelloHasServerModeAndBodies) {
  const SceneModel model{3, {{1, "anymal"}, {7, "drone"}}};
  expect_members(Json::parse(encode_hello({"0.1.0", "frozen", 20}, model)), R"({
    "type": "hello", "server": "fiducapd", "version": "0.1.0", "map_mode": "frozen",
    "page_rate_hz": 20, "bodies": [{"id": 1, "name": "anymal"}, {"id": 7, "name": "drone"}]})");
}

TEST(WebCodec, InvalidUtf8OfNamesIsReplaced) {
  for (const auto& [name, expected] : std::vector<std::pair<std::string, std::string>>{
           {"r\xff\xfe", "r\uFFFD\uFFFD"}, {"an\xffy\"mal\n", "an\uFFFDy\"mal\n"}}) {
    const SceneModel model{1, {{1, name}}};
    EXPECT_EQ(Json::parse(encode_hello({}, model))["bodies"][0]["name"], expected);
  }
}

TEST(WebCodec, FrameHasPosesWithTheirQuality) {
  const auto scene = make_scene_frame({"a", "b"}, 9);
  auto& body = scene->bodies[1];
  body.processing = std::chrono::microseconds(8400);
  body.images_dropped = 4;
  body.reprojection_px = 0.35;
  body.covariance.topLeftCorner<3, 3>() << 1, 2, 3, 2, 4, 5, 3, 5, 6;
  const Json frame = encoded(*scene);
  expect_members(frame, R"({"number": 9, "rate_hz": 100})");
  EXPECT_EQ(frame["utc_ms"], scene->utc_ns() / 1'000'000);
  const auto& sent = frame["bodies"][1];
  // The speed is |(0.5, -0.25, 0.125)|, sigma_deg 10 mrad, cov the upper triangle row by row.
  expect_members(sent, R"({
    "id": 2, "state": "tracking", "valid": true, "p": [2, -2, 0.5], "speed": 0.573,
    "sigma_deg": 0.573, "age_ms": 20, "latency_ms": 8.4, "tags": 3, "image_rate_hz": 20,
    "reprojection_px": 0.35, "images_dropped": 4, "cov": [1, 2, 3, 4, 5, 6]})");
  EXPECT_EQ(frame["bodies"][0]["sigma_mm"], 10);
  EXPECT_NEAR(sent["q"][0].get<double>(), body.X_WP.q.w(), kWrittenDigits);
  EXPECT_NEAR(sent["q"][1].get<double>(), body.X_WP.q.x(), kWrittenDigits);
  EXPECT_NEAR(sent["q"][3].get<double>(), body.X_WP.q.z(), kWrittenDigits);
}

TEST(WebCodec, BodyWithoutTagsHasItsLastPoseOrNone) {
  for (const BodyState state : {BodyState::kSearching, BodyState::kLost}) {
    const auto scene = make_scene_frame({"a", "b"});
    scene->bodies[0] = BodyPose{};  // was never placed
    for (auto& body : scene->bodies) {
      body.state = state;
      body.valid = false;
    }
    const Json bodies = encoded(*scene)["bodies"];
    for (const char* name : {"p", "q", "v", "speed", "sigma_mm", "sigma_deg", "cov", "age_ms"})
      EXPECT_TRUE(bodies[0].at(name).is_null()) << name;
    EXPECT_EQ(bodies[1]["valid"], false);
    EXPECT_EQ(bodies[1]["state"], name_of(state));
    EXPECT_TRUE(bodies[1]["p"].is_array());
  }
}

TEST(WebCodec, NumbersThatAreNotFiniteAreNull) {
  const auto scene = make_scene_frame({"a"});
  scene->bodies[0].X_WP.p.y() = std::numeric_limits<double>::quiet_NaN();
  scene->bodies[0].reprojection_px = std::numeric_limits<double>::infinity();
  const Json body = encoded(*scene)["bodies"][0];
  EXPECT_TRUE(body["p"][1].is_null());
  EXPECT_TRUE(body["reprojection_px"].is_null());
}

TEST(WebCodec, MapHasAllTagsWithTheirStates) {
  TagMap map;
  map.version = 12;
  EXPECT_TRUE(Json::parse(encode_map(map))["reference_tag"].is_null());
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
  expect_members(sent, R"({"version": 12, "family": "tag36h11", "reference_tag": 5})");
  expect_members(sent["tags"][0], R"({"id": 5, "edge_m": 0.16, "state": "surveyed", "p": [1, 2, 3],
                                      "q": [1, 0, 0, 0], "sigma_mm": 2, "sightings": 77})");
}

TEST(WebCodec, FitsHaveResidualCountAndTime) {
  const std::vector<TagFit> fits{{7, 0.31249, 12, instant_from_ns(2'000'000'000)}};
  EXPECT_EQ(Json::parse(encode_fits(fits, std::chrono::seconds(100))),
            Json::parse(R"({"type": "fits", "tags": [{"id": 7, "px": 0.312, "sightings": 12,
                                                      "last_seen_utc_ms": 102000}]})"));
}

TEST(WebCodec, VersionsHaveTheirComments) {
  const MapVersionInfo one{7, 3, 1'700'000'000'123'456'789, "hash", "before the \"move\"", 24};
  expect_members(Json::parse(encode_versions(std::span(&one, 1)))["versions"][0],
                 R"({"version": 7, "parent": 3, "utc_ms": 1700000000123, "tags": 24,
                     "comment": "before the \"move\""})");
}

TEST(WebCodec, DiffHasBothPlacesAndTheDistance) {
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
  expect_members(sent, R"({"before": 3, "after": 7})");
  ASSERT_EQ(sent["changes"].size(), 2U);
  expect_members(sent["changes"][0], R"({"mm": 12, "from": [0, 0, 0], "to": [0, 0.012, 0]})");
  expect_members(sent["changes"][1], R"({"kind": "removed", "to": null})");
}

TEST(WebCodec, ClientsHaveTheirDropsAndClocks) {
  const std::vector<ClientStatus> clients{{"vrpn", "10.0.0.2:4 udp", "z-up m", 100, 3, 1.5},
                                          {"native", "p", "d", 0, 0, 0, ClockOffset{-0.25, 0.001}}};
  const auto sent = Json::parse(encode_clients(clients));
  EXPECT_EQ(sent["clients"][0],
            Json::parse(R"({"protocol": "vrpn", "peer": "10.0.0.2:4 udp", "detail": "z-up m",
                            "sent": 100, "dropped": 3, "connected_s": 1.5,
                            "clock_offset_s": null, "clock_sigma_s": null})"));
  expect_members(sent["clients"][1], R"({"clock_offset_s": -0.25, "clock_sigma_s": 0.001})");
}

TEST(WebCodec, LongLogTextIsCut) {
  const std::vector<log::Line> lines{
      {4, 1700, log::Level::kWarning, "vrpn", std::string(5000, 'x')}};
  const auto line = Json::parse(encode_log(lines))["lines"][0];
  expect_members(line, R"({"n": 4, "level": "warning"})");
  EXPECT_EQ(line["text"].get<std::string>().size(), 1000);
}

TEST(WebCodec, StateJoinsTheMessagesWithNullForMissingOnes) {
  const auto state =
      Json::parse(encode_state({R"({"type":"hello"})", "", "", "", R"({"clients":[]})", "", ""}));
  expect_members(state, R"({"hello": {"type": "hello"}, "map": null, "frame": null,
                            "clients": {"clients": []}})");
}

TEST(WebCodec, EventsHaveConditionsAndTheNewestEvents) {
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
            Json::parse(R"({"n": 4, "utc_ms": 1000, "severity": "warning", "subject": "drone",
                            "kind": "coasting", "text": "sees no tag",
                            "remedy": "Look at the camera", "over": false})"));
  expect_members(events["events"][0], R"({"severity": "info", "over": true})");
  const std::vector<Event> invalid{
      {.subject = "drone", .kind = "x", .text = "\xff\"\n" + std::string(5000, 'x')}};
  const auto sent = Json::parse(encode_events(invalid, {}));
  EXPECT_LE(sent["standing"][0]["text"].get<std::string>().size(), 1002u);
}

TEST(WebCodec, FailedAllocationIsAnExceptionAtEachPlace) {
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

}  // namespace
}  // namespace fiducap::web
