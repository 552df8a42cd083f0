#include "streaming/web/metrics.hpp"

#include <gmock/gmock.h>

#include <set>
#include <sstream>

#include "support/scene_builder.hpp"

namespace fiducap::web {
namespace {

using testing::HasSubstr;
using testing::Not;

class MetricsTest : public testing::Test {
 protected:
  [[nodiscard]] std::string text(MetricsFormat format = MetricsFormat::kPrometheus) const {
    return encode_metrics({.version = "0.1.0",
                           .healthy = true,
                           .frame = frame_.get(),
                           .model = frame_->model.get(),
                           .protocols = protocols_,
                           .alarms = alarms_,
                           .events = {7, 2, 1},
                           .process = {4096, 12}},
                          format);
  }
  void expect_lines(std::initializer_list<std::string> lines) const {
    for (const auto& line : lines) EXPECT_THAT(text(), HasSubstr("\n" + line + "\n"));
  }

  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"anymal", "drone"}, 9);
  std::map<std::string, Traffic> protocols_{{"vrpn", {2, 900, 3}}};
  std::vector<Event> alarms_;
};

TEST_F(MetricsTest, HaveServerProtocolsEventsAndProcess) {
  expect_lines(
      {R"(fiducap_build_info{version="0.1.0"} 1)", "fiducap_healthy 1",
       "fiducap_frames_published_total 9", R"(fiducap_protocol_clients{protocol="vrpn"} 2)",
       R"(fiducap_protocol_frames_sent_total{protocol="vrpn"} 900)",
       R"(fiducap_protocol_frames_dropped_total{protocol="vrpn"} 3)",
       R"(fiducap_events_total{severity="info"} 7)", R"(fiducap_events_total{severity="error"} 1)",
       "fiducap_process_resident_bytes 4096", "fiducap_process_open_fds 12"});
}

TEST_F(MetricsTest, HaveEachBodyByName) {
  frame_->bodies[1].images_dropped = 4;
  expect_lines({R"(fiducap_body_valid{body="drone"} 1)",
                R"(fiducap_body_state{body="drone",state="tracking"} 1)",
                R"(fiducap_body_state{body="drone",state="lost"} 0)",
                R"(fiducap_body_age_seconds{body="drone"} 0.02)",
                R"(fiducap_body_position_sigma_meters{body="anymal"} 0.01)",
                R"(fiducap_body_image_rate_hertz{body="drone"} 20)",
                R"(fiducap_body_images_dropped_total{body="drone"} 4)"});
}

TEST_F(MetricsTest, BodyThatWasNeverPlacedHasNoSigma) {
  frame_->bodies[0] = BodyPose{.body_id = 1};
  EXPECT_THAT(text(), Not(HasSubstr(R"(sigma_meters{body="anymal"})")));
  EXPECT_THAT(text(), HasSubstr(R"(sigma_meters{body="drone"})"));
  expect_lines({R"(fiducap_body_valid{body="anymal"} 0)"});
}

TEST_F(MetricsTest, AlarmsHaveEscapedLabels) {
  alarms_ = {{.severity = Severity::kError, .subject = "drone", .kind = "lost", .text = "why"},
             {.subject = "a\"} 5\nfake 1 \\", .kind = "x", .text = "why"}};
  expect_lines({R"(fiducap_alarm{subject="drone",kind="lost",severity="error"} 1)",
                R"(fiducap_alarm{subject="a\"} 5\nfake 1 \\",kind="x",severity="info"} 1)"});
}

/// Every sample belongs to the family before it, families come once, no sample comes twice.
void expect_well_formed(const std::string& text, bool open_metrics) {
  std::istringstream lines(text);
  std::set<std::string> families;
  std::set<std::string> samples;
  std::string family;
  std::string type;
  for (std::string line; std::getline(lines, line);) {
    if (line == "# EOF") continue;
    std::istringstream words(line);
    std::string first, second, third, fourth;
    words >> first >> second >> third >> fourth;
    if (first == "#") {
      if (second != "TYPE") continue;
      family = third;
      type = fourth;
      EXPECT_TRUE(families.insert(family).second) << line;
      continue;
    }
    const std::string name = line.substr(0, line.find_first_of("{ "));
    EXPECT_EQ(name, open_metrics && type == "counter" ? family + "_total" : family) << line;
    EXPECT_TRUE(samples.insert(line.substr(0, line.rfind(' '))).second) << line;
  }
  EXPECT_GT(families.size(), 10u);
}

TEST_F(MetricsTest, AreWellFormedInBothFormats) {
  alarms_ = {{.subject = "drone", .kind = "lost", .text = "why"},
             {.subject = "map", .kind = "store", .text = "why"}};
  expect_well_formed(text(MetricsFormat::kPrometheus), false);
  expect_well_formed(text(MetricsFormat::kOpenMetrics), true);
  EXPECT_TRUE(text(MetricsFormat::kOpenMetrics).ends_with("\n# EOF\n"));
}

TEST_F(MetricsTest, HaveNoBodiesWithoutAFrame) {
  const std::string none = encode_metrics({.protocols = protocols_}, MetricsFormat::kPrometheus);
  EXPECT_THAT(none, HasSubstr("\nfiducap_frames_published_total 0\n"));
  EXPECT_THAT(none, Not(HasSubstr("body=\"")));
}

TEST(ProcessUse, IsThatOfThisProcess) {
  const ProcessUse use = process_use();
  EXPECT_GT(use.resident_bytes, 1u << 20);
  EXPECT_GE(use.open_fds, 3u);
}

TEST(ClientTally, SumsNeverDecreaseWhenClientsLeave) {
  ClientTally tally;
  const auto expect = [&](std::vector<ClientStatus> clients, std::uint64_t sent) {
    tally.note(clients);
    const Traffic vrpn = tally.traffic().at("vrpn");
    EXPECT_EQ(vrpn.clients, clients.size());
    EXPECT_EQ(vrpn.sent, sent);
    EXPECT_EQ(vrpn.dropped, 2u);
  };
  const ClientStatus first{"vrpn", "10.0.0.1:5 tcp", "", 100, 2, 1};
  ClientStatus second{"vrpn", "10.0.0.2:5 tcp", "", 50, 0, 1};
  expect({first, second}, 150);
  second.frames_sent = 80;
  expect({second}, 180);
  second.frames_sent = 5;  // another client with the same port
  expect({second}, 185);
  expect({}, 185);
}

}  // namespace
}  // namespace fiducap::web
