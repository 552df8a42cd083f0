// Conditions and events in the form of ROS.
#include "dds_server_fixture.hpp"

#include <dds/dds.h>
#include <fiducap_dds/fiducap.h>
#include <fiducap_dds/ros_geometry.h>
#include <fiducap_dds/ros_mocap.h>

#include <optional>
#include <string>
#include <vector>

namespace fiducap::dds {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

using Diagnostics = diagnostic_msgs_msg_dds__DiagnosticArray_;

class DdsDiagnosticsTest : public DdsServerTest {
 protected:
  void start_and_read() {
    start({});
    reader_.emplace(read("rt/diagnostics", diagnostic_msgs_msg_dds__DiagnosticArray__desc));
  }
  void begin(Severity severity, std::string subject, std::string kind, std::string text,
             std::string remedy) {
    events_.begin({.severity = severity,
                   .subject = std::move(subject),
                   .kind = std::move(kind),
                   .text = std::move(text),
                   .remedy = std::move(remedy)});
  }
  /// `level name: message` of each
  static std::vector<std::string> texts_of(const Diagnostics& message) {
    std::vector<std::string> all;
    for (std::uint32_t i = 0; i < message.status._length; ++i) {
      const auto& [level, name, text, hardware_id, values] = message.status._buffer[i];
      all.push_back(std::to_string(level) + " " + name + ": " + text);
    }
    return all;
  }
  /// `key=value|…` of one
  static std::string values_of(const Diagnostics& message, std::size_t index) {
    std::string text;
    const auto& values = message.status._buffer[index].values;
    for (std::uint32_t i = 0; i < values._length; ++i)
      text += std::string(values._buffer[i].key) + "=" + values._buffer[i].value + "|";
    return text;
  }
  std::optional<Reader> reader_;
};

TEST_F(DdsDiagnosticsTest, ComeOnceASecondWithTheStates) {
  frame_->bodies[1].state = BodyState::kCoasting;
  start_and_read();
  publish(250);
  int count = 0;
  while (const auto loan = reader_->take()) {
    ++count;
    const auto& message = loan.as<Diagnostics>();
    ASSERT_THAT(texts_of(message),
                ElementsAre("0 fiducap: big-drone: tracking", "1 fiducap: rover: coasting",
                            "0 fiducap: server: runs"));
    EXPECT_STREQ(message.status._buffer[0].values._buffer[2].value, "3");
  }
  EXPECT_EQ(count, 3);
}

TEST_F(DdsDiagnosticsTest, ReportBeginAndEndOfConditionsAtOnce) {
  start_and_read();
  publish(120);
  while (reader_->take()) continue;
  begin(Severity::kError, "rover", "device_gone", "its camera is gone", "Look at the cable.");
  begin(Severity::kWarning, "clock", "unsynchronised", "it is not set", "Start chrony.");
  publish(20);  // 0.2 s
  const auto alarm = reader_->take();
  ASSERT_TRUE(alarm);
  EXPECT_FALSE(reader_->take()) << "sent once, not with every frame";
  const auto& message = alarm.as<Diagnostics>();
  ASSERT_THAT(texts_of(message),
              ElementsAre("0 fiducap: big-drone: tracking", "2 fiducap: rover: its camera is gone",
                          "1 fiducap: server: clock: it is not set"));
  EXPECT_THAT(values_of(message, 1),
              HasSubstr("device_gone=its camera is gone|device_gone, remedy=Look at the cable.|"));
  EXPECT_EQ(values_of(message, 2),
            "clock: unsynchronised=it is not set|clock: unsynchronised, remedy=Start chrony.|");
  events_.end("rover", "device_gone", "is back");
  events_.end("clock", "unsynchronised", "is set again");
  publish(20);
  const auto ended = reader_->take();
  ASSERT_TRUE(ended);
  EXPECT_THAT(texts_of(ended.as<Diagnostics>()),
              ElementsAre("0 fiducap: big-drone: tracking", "0 fiducap: rover: tracking",
                          "0 fiducap: server: runs"));
}

TEST_F(DdsDiagnosticsTest, KeepTheConditionsOfARenamedBody) {
  start_and_read();
  begin(Severity::kError, "rover", "tracking", "is lost", "Show it a tag.");
  publish();
  while (reader_->take()) continue;
  auto model = std::make_shared<SceneModel>(*frame_->model);
  model->generation = 2;
  model->bodies[1].name = "uav1";
  frame_ = std::make_shared<SceneFrame>(*frame_);
  frame_->model = model;
  events_.rename("rover", "uav1");
  publish(120);
  const auto loan = reader_->take();
  ASSERT_TRUE(loan);
  EXPECT_THAT(texts_of(loan.as<Diagnostics>()),
              ElementsAre("0 fiducap: big-drone: tracking", "2 fiducap: uav1: is lost",
                          "0 fiducap: server: runs"));
}

}  // namespace
}  // namespace fiducap::dds
