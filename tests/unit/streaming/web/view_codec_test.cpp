#include "streaming/web/view_codec.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "expect_members.hpp"

namespace fiducap::web {
namespace {

using Json = nlohmann::json;

TEST(ViewCodec, DecodesRequests) {
  const auto requests = parse_view_requests("1/0/640/10/1 2/3/320/2/0");
  ASSERT_TRUE(requests.has_value());
  EXPECT_EQ(*requests,
            (std::vector<CameraRequest>{{1, 0, {640, 10, true}}, {2, 3, {320, 2, false}}}));
  EXPECT_TRUE(parse_view_requests("")->empty());
}

TEST(ViewCodec, RefusesInvalidRequests) {
  for (const char* text :
       {" ", "1", "1/0", "1/0/640/10", "1/0/640/10/", "1/0/640/10/2", "1/0/640/10/-1",
        "-1/0/640/10/0", "1/0/79/10/0", "1/0/4097/10/0", "1/0/640/0/0", "1/0/640/11/0",
        "1/0/640/10/0/5", "1/0/640/10/0  2/0/640/10/0", "a/0/640/10/0",
        "1/0/99999999999999999999/10/0", "1/0/640/10/0\n", "+1/0/640/10/0", "1 /0/640/10/0"}) {
    const auto requests = parse_view_requests(text);
    ASSERT_FALSE(requests.has_value()) << text;
    EXPECT_NE(requests.error().what.find("BODY/CAMERA"), std::string::npos)
        << requests.error().what;
  }
}

TEST(ViewCodec, LimitsTheNumberOfCameras) {
  std::string text = "1/0/640/10/0";
  for (std::size_t i = 1; i < kMostViewRequests; ++i) text += " 1/0/640/10/0";
  EXPECT_EQ(parse_view_requests(text)->size(), kMostViewRequests);
  const auto more = parse_view_requests(text + " 1/0/640/10/0");
  ASSERT_FALSE(more.has_value());
  EXPECT_EQ(more.error().what, "expected at most 16 cameras at once");
}

TEST(ViewCodec, ListHasCamerasAndAccess) {
  const std::vector<CameraViews::Camera> cameras{{7, 1, 752, 480, 20}};
  expect_members(Json::parse(encode_view_list({ViewAccess::Kind::kDenied, "it is off"}, cameras)),
                 R"({"access": "denied", "why": "it is off",
          "cameras": [{"body": 7, "camera": 1, "width": 752, "height": 480, "rate_hz": 20}]})");
}

class ViewMessageTest : public testing::Test {
 protected:
  ViewMessageTest() {
    view_.camera = 1;
    view_.width = 752;
    view_.height = 480;
    view_.rate_hz = 19.96;
    view_.outlines.resize(1);
    view_.outlines[0].tag_id = 7;
    view_.outlines[0].kind = ViewOutline::Kind::kRejected;
    view_.outlines[0].why = UnusedBecause::kGate;
    view_.outlines[0].decision_margin = 61.26;
    for (std::size_t i = 0; i < 4; ++i)
      view_.outlines[0].corners_px[i] = {static_cast<double>(i) + 0.126, 5};
    picture_.body_id = 3;
    picture_.utc_ms = 1'790'000'000'123;
  }
  [[nodiscard]] Json header(const std::string& message) const {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(message.at(i)); };
    const std::size_t size = byte(0) | byte(1) << 8 | byte(2) << 16 | byte(3) << 24;
    return Json::parse(message.substr(4, size));
  }

  CameraView view_;
  ViewPicture picture_;
};

TEST_F(ViewMessageTest, IsHeaderLengthHeaderAndPicture) {
  const std::vector<std::uint8_t> jpeg{0xff, 0xd8, 0x00};
  const std::string message = encode_view(view_, picture_, jpeg);
  EXPECT_EQ(message.substr(message.size() - 3), std::string("\xff\xd8\0", 3));
  const Json json = header(message);
  // Without pixels there is no exposure; the speed is unknown.
  expect_members(json, R"({"body": 3, "camera": 1, "utc_ms": 1790000000123, "rate_hz": 20,
                           "exposure": null, "speed_px_s": null})");
  expect_members(json["outlines"][0],
                 R"({"kind": "rejected", "why": "gate", "margin": 61.3, "fit_px": null,
                     "px": [0.13, 5, 1.13, 5, 2.13, 5, 3.13, 5]})");
}

TEST_F(ViewMessageTest, HasExposureAndCandidates) {
  ImageMeasures measures;
  measures.mean = 101.26;
  measures.histogram[63] = 9;
  picture_.measures = &measures;
  picture_.has_candidates = true;
  const std::vector<TagCandidate> candidates{{TagCandidate::Why::kLowMargin, 5, 1, 12, {}},
                                             {TagCandidate::Why::kUnread, -1, 0, 0, {}}};
  picture_.candidates = candidates;
  const Json json = header(encode_view(view_, picture_, {}));
  EXPECT_EQ(json["exposure"]["mean"], 101.3);
  EXPECT_EQ(json["exposure"]["histogram"].size(), 64u);
  EXPECT_EQ(json["exposure"]["histogram"][63], 9);
  EXPECT_TRUE(json["candidates"]);
  ASSERT_EQ(json["outlines"].size(), 3u);
  expect_members(json["outlines"][0], R"({"kind": "candidate", "id": 5, "why": "low_margin"})");
  EXPECT_TRUE(json["outlines"][1]["id"].is_null());
}

TEST_F(ViewMessageTest, NumberThatIsNotFiniteIsNull) {
  view_.outlines[0].corners_px[2].x() = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(header(encode_view(view_, picture_, {}))["outlines"][0]["px"][4].is_null());
}

}  // namespace
}  // namespace fiducap::web
