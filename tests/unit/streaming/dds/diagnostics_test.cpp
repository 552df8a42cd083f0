// What a person should know, as ROS reads it.
#include "dds_server_fixture.hpp"

#include <dds/dds.h>
#include <fiducap_dds/fiducap.h>
#include <fiducap_dds/ros_geometry.h>
#include <fiducap_dds/ros_mocap.h>

#include <string>

namespace fiducap::dds {
namespace {

using testing::HasSubstr;

TEST_F(DdsServerTest, DiagnosticsComeOnceASecondAndSayWhatIsWrong) {
  frame_->bodies[1].state = BodyState::kCoasting;
  start({});
  auto reader = read("rt/diagnostics", diagnostic_msgs_msg_dds__DiagnosticArray__desc);
  for (int i = 0; i < 250; ++i) publish();
  int count = 0;
  while (const auto loan = reader.take()) {
    ++count;
    const auto& message = loan.as<diagnostic_msgs_msg_dds__DiagnosticArray_>();
    ASSERT_EQ(message.status._length, 3u);
    EXPECT_STREQ(message.status._buffer[2].name, "fiducap: server");
    EXPECT_STREQ(message.status._buffer[2].message, "runs");
    EXPECT_EQ(message.status._buffer[2].level, 0);
    EXPECT_EQ(message.status._buffer[0].level, 0);
    EXPECT_EQ(message.status._buffer[1].level, 1);
    EXPECT_STREQ(message.status._buffer[1].name, "fiducap: rover");
    EXPECT_STREQ(message.status._buffer[1].message, "coasting");
    EXPECT_STREQ(message.status._buffer[0].values._buffer[2].value, "3");
  }
  EXPECT_EQ(count, 3);
}

/// `key=value|…`
std::string values_of(const diagnostic_msgs_msg_dds__DiagnosticStatus_& status) {
  std::string text;
  for (std::uint32_t i = 0; i < status.values._length; ++i) {
    const auto& pair = status.values._buffer[i];
    text += std::string(pair.key) + "=" + pair.value + "|";
  }
  return text;
}

TEST_F(DdsServerTest, DiagnosticsReportBeginAndEndAtOnceWithCauseAndRemedy) {
  start({});
  auto reader = read("rt/diagnostics", diagnostic_msgs_msg_dds__DiagnosticArray__desc);
  for (int i = 0; i < 120; ++i) publish();
  while (reader.take()) continue;
  events_.begin({.severity = Severity::kError,
                 .subject = "rover",
                 .kind = "device_gone",
                 .text = "its camera is gone",
                 .remedy = "Look at the cable."});
  events_.begin({.severity = Severity::kWarning,
                 .subject = "clock",
                 .kind = "unsynchronised",
                 .text = "nobody sets it",
                 .remedy = "Start chrony."});
  for (int i = 0; i < 20; ++i) publish();  // 0.2 s
  const auto alarm = reader.take();
  ASSERT_TRUE(alarm);
  EXPECT_FALSE(reader.take()) << "sent once, not with every frame";
  const auto& message = alarm.as<diagnostic_msgs_msg_dds__DiagnosticArray_>();
  ASSERT_EQ(message.status._length, 3u);
  const auto* status = message.status._buffer;
  EXPECT_EQ(status[0].level, 0);
  EXPECT_EQ(status[1].level, 2);
  EXPECT_STREQ(status[1].message, "its camera is gone");
  EXPECT_THAT(values_of(status[1]),
              HasSubstr("device_gone=its camera is gone|device_gone, remedy=Look at the cable.|"));
  EXPECT_EQ(status[2].level, 1);
  EXPECT_STREQ(status[2].message, "clock: nobody sets it");
  EXPECT_EQ(values_of(status[2]),
            "clock: unsynchronised=nobody sets it|clock: unsynchronised, remedy=Start chrony.|");
  events_.end("rover", "device_gone", "is back");
  events_.end("clock", "unsynchronised", "is set again");
  for (int i = 0; i < 20; ++i) publish();
  const auto ended = reader.take();
  ASSERT_TRUE(ended);
  const auto& after = ended.as<diagnostic_msgs_msg_dds__DiagnosticArray_>();
  EXPECT_EQ(after.status._buffer[1].level, 0);
  EXPECT_STREQ(after.status._buffer[1].message, "tracking");
  EXPECT_STREQ(after.status._buffer[2].message, "runs");
}

TEST_F(DdsServerTest, DiagnosticsOfARenamedBodyKeepItsConditions) {
  start({});
  auto reader = read("rt/diagnostics", diagnostic_msgs_msg_dds__DiagnosticArray__desc);
  events_.begin({.severity = Severity::kError,
                 .subject = "rover",
                 .kind = "tracking",
                 .text = "is lost",
                 .remedy = "Show it a tag."});
  publish();
  while (reader.take()) continue;
  auto model = std::make_shared<SceneModel>(*frame_->model);
  model->generation = 2;
  model->bodies[1].name = "uav1";
  frame_ = std::make_shared<SceneFrame>(*frame_);
  frame_->model = model;
  events_.rename("rover", "uav1");
  for (int i = 0; i < 120; ++i) publish();
  const auto loan = reader.take();
  ASSERT_TRUE(loan);
  const auto& message = loan.as<diagnostic_msgs_msg_dds__DiagnosticArray_>();
  ASSERT_EQ(message.status._length, 3u);
  EXPECT_STREQ(message.status._buffer[1].name, "fiducap: uav1");
  EXPECT_STREQ(message.status._buffer[1].message, "is lost");
  EXPECT_STREQ(message.status._buffer[2].message, "runs") << "it is not the server's";
}

}  // namespace
}  // namespace fiducap::dds
