#include "capture/imu/byte_link.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class LinkWatchTest : public testing::Test {
 protected:
  std::string add(std::size_t bytes, std::size_t printable, std::uint64_t units,
                  std::uint64_t broken = 0) {
    now_ += 100ms;
    watch_.add(bytes, printable, units, broken, now_);
    return watch_.take_event().value_or("");
  }
  LinkWatch watch_{"line of the IMU protocol", true, 115200};
  Instant now_{};
};

TEST_F(LinkWatchTest, SaysNothingWhileTheProtocolComes) {
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(add(200, 200, 4), "");
}

TEST_F(LinkWatchTest, GarbageIsTakenForAWrongBaudRate) {
  EXPECT_EQ(add(4000, 1500, 0), "");
  const std::string said = add(100, 40, 0);
  EXPECT_THAT(said, HasSubstr("no line of the IMU protocol among 4100 bytes"));
  EXPECT_THAT(said, HasSubstr("is the baud rate right (115200 here)?"));
  EXPECT_EQ(add(9000, 4000, 0), "") << "once";
}

TEST_F(LinkWatchTest, AnotherTextIsToldApart) {
  EXPECT_THAT(add(5000, 5000, 0), HasSubstr("but another text: is it the right device?"));
}

TEST_F(LinkWatchTest, ChecksumsThatAreAllWrongAreToldApart) {
  EXPECT_THAT(add(5000, 5000, 0, 100), HasSubstr("with a wrong checksum"));
}

TEST_F(LinkWatchTest, GarbageByUdpIsNoMatterOfABaudRate) {
  watch_ = LinkWatch("MAVLink frame", false, 115200);
  EXPECT_THAT(add(5000, 1000, 0), HasSubstr("another protocol is sent to this port"));
}

TEST_F(LinkWatchTest, SilenceIsSaidOnceAndItsEndToo) {
  std::string said;
  for (int i = 0; i < 200; ++i) said += add(0, 0, 0);
  EXPECT_THAT(said, HasSubstr("nothing received for 5 s"));
  EXPECT_EQ(said.find("nothing", said.find("nothing") + 1), std::string::npos);
  EXPECT_EQ(add(50, 50, 1), "it sends again");
}

TEST_F(LinkWatchTest, ADisturbedLineIsSaidWithItsShare) {
  std::string said;
  for (int i = 0; i < 100; ++i) said += add(700, 600, 9, 1);
  EXPECT_THAT(said, HasSubstr("100 of 1000 have a wrong checksum"));
  for (int i = 0; i < 100; ++i) EXPECT_EQ(add(700, 600, 9, 1), "") << "once";
}

TEST_F(LinkWatchTest, AFewWrongChecksumsAreNothing) {
  for (int i = 0; i < 500; ++i) EXPECT_EQ(add(700, 700, 10, i % 50 == 0 ? 1 : 0), "");
}

}  // namespace
}  // namespace fiducap
