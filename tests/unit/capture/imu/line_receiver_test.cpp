#include "capture/imu/line_receiver.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <random>

#include "capture/imu/byte_link.hpp"
#include "support/allocation_counter.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr Instant kReceiverStart = instant_from_ns(900'000'000'000);

// The example of docs/imu-line-protocol.md.
const std::string kReading = "IMU,1000000,0.01,-0.02,0.03,0.1,-0.2,9.81*";

std::string with_checksum(const std::string& text) {
  unsigned sum = 0;
  for (const char c : text) sum ^= static_cast<unsigned char>(c);
  constexpr const char* kDigits = "0123456789ABCDEF";
  return text + "*" + kDigits[sum / 16] + kDigits[sum % 16];
}

std::string reading(std::uint64_t count_us) {
  return with_checksum("IMU," + std::to_string(count_us) + ",0.01,-0.02,0.03,0.1,-0.2,9.81") + "\n";
}

LineFault line_fault_of(const std::string& line) { return std::get<LineFault>(parse_line(line)); }

class LineReceiverTest : public testing::Test {
 protected:
  void give(const std::string& text) { receiver_.receive(bytes_of(text), now_); }
  int take_all() {
    int samples = 0;
    while (const auto sample = receiver_.take()) {
      newest_ = *sample;
      ++samples;
    }
    return samples;
  }

  LineReceiver receiver_;
  Instant now_{kReceiverStart};
  ImuSample newest_;
};

TEST(LineParser, ReadsTheExampleOfTheDocumentation) {
  const auto imu = std::get<ImuLine>(parse_line(kReading + "4F"));
  EXPECT_EQ(imu.count_us, 1'000'000u);
  EXPECT_EQ(imu.w, Eigen::Vector3d(0.01, -0.02, 0.03));
  EXPECT_EQ(imu.f, Eigen::Vector3d(0.1, -0.2, 9.81));
}

TEST(LineParser, DistinguishesChecksumAndForm) {
  EXPECT_EQ(line_fault_of(kReading + "41"), LineFault::kChecksum);
  for (const std::string& line : {kReading, std::string("hello"), std::string(), kReading + "4G"})
    EXPECT_EQ(line_fault_of(line), LineFault::kForm);
  for (const char* text :
       {"IMU,1,2,3,4,5,6", "IMU,1,2,3,4,5,6,7,8", "IMU,-1,0,0,0,0,0,9", "IMU,1,nan,0,0,0,0,9",
        "IMU,1,inf,0,0,0,0,9", "IMU,1,0,0,,0,0,9", "IMU,1, 0,0,0,0,0,9", "GPS,1,0,0,0,0,0,9",
        "TRG,1", "TRG,1,2,3", "IMU,99999999999999999999,0,0,0,0,0,9", "IMU,1,0,0,0,0,0,1e999"})
    EXPECT_EQ(line_fault_of(with_checksum(text)), LineFault::kForm) << text;
}

TEST_F(LineReceiverTest, IgnoresAPartialFirstLine) {
  give(".02,0.03,0.1,-0.2,9.81*4F\r\n" + reading(5000));
  EXPECT_EQ(take_all(), 1);
  EXPECT_EQ(receiver_.counts().malformed, 0u);
  EXPECT_EQ(newest_.f_B, Eigen::Vector3d(0.1, -0.2, 9.81));
}

TEST_F(LineReceiverTest, ReadsLinesInPiecesAndBlocks) {
  // Eight at a time, as a USB chip passes them on.
  give("\n");
  std::string block;
  for (int i = 0; i < 4000; ++i, now_ += 5ms) {
    block += reading(static_cast<std::uint64_t>(i) * 5000) + (i % 100 == 0 ? "\r\n" : "");
    if (i % 8 < 7) continue;
    give(block.substr(0, 11));
    give(block.substr(11));
    block.clear();
    if (i < 2000) continue;
    EXPECT_GE(take_all(), 8);
    EXPECT_EQ(newest_.sampled_at, now_) << "the newest of a block is the quickest";
  }
}

TEST_F(LineReceiverTest, CountsFaultsAndReadsTheOtherLines) {
  give("\n# started\nIMU,1,2*00\n" + kReading + "41\n" + std::string(500, 'x') + "\n" +
       reading(20'000));
  EXPECT_EQ(take_all(), 1);
  EXPECT_THAT(receiver_.counts(), testing::FieldsAre(1u, 0u, 2u, 1u, 1u))
      << "readings, triggers, wrong checksums, malformed, comments";
}

TEST_F(LineReceiverTest, PlacesATriggerByTheSameClock) {
  give("\n");
  for (int i = 0; i < 1000; ++i, now_ += 5ms) give(reading(static_cast<std::uint64_t>(i) * 5000));
  EXPECT_EQ(take_all(), 1000);
  give(with_checksum("TRG,4992500,33") + "\n");
  ASSERT_TRUE(receiver_.trigger());
  EXPECT_EQ(newest_.sampled_at - receiver_.trigger()->at, 2500us);
  EXPECT_EQ(receiver_.trigger()->number, 33u);
  EXPECT_EQ(receiver_.counts().triggers, 1u);
}

TEST_F(LineReceiverTest, ToleratesAnyBytes) {
  std::mt19937 random(3);
  for (int i = 0; i < 1000; ++i, now_ += 1ms) {
    std::string text(64, 0);
    for (char& c : text) c = static_cast<char>(random());
    give(text);
  }
  EXPECT_EQ(take_all(), 0);
  give("\n" + reading(1000));
  EXPECT_EQ(take_all(), 1);
}

TEST_F(LineReceiverTest, AllocatesNothingPerReadingAfterWarmUp) {
  give("\n" + reading(5000));
  EXPECT_EQ(take_all(), 1);
  const std::string next = reading(10'000);
  now_ += 5ms;
  const AllocationCounter allocations;
  give(next);
  EXPECT_TRUE(receiver_.take());
  EXPECT_EQ(allocations.count(), 0u);
}

class LinkWatchTest : public testing::Test {
 protected:
  std::string add(std::size_t bytes, std::size_t printable, std::uint64_t units,
                  std::uint64_t broken = 0) {
    now_ += 100ms;
    return watch_.add(bytes, printable, units, broken, now_);
  }
  void reset() { watch_ = LinkWatch("line of the IMU protocol", true, 115200); }

  LinkWatch watch_{"line of the IMU protocol", true, 115200};
  Instant now_{};
};

TEST_F(LinkWatchTest, ReportsNothingOfAGoodLine) {
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(add(200, 200, 4), "");
  reset();
  for (int i = 0; i < 500; ++i) EXPECT_EQ(add(700, 700, 10, i % 50 == 0 ? 1 : 0), "");
}

TEST_F(LinkWatchTest, ReportsWhyNothingCanBeRead) {
  EXPECT_EQ(add(4000, 1500, 0), "");
  const std::string text = add(100, 40, 0);
  EXPECT_THAT(text, HasSubstr("no line of the IMU protocol among 4100 bytes"));
  EXPECT_THAT(text, HasSubstr("is the baud rate right (115200 here)?"));
  EXPECT_EQ(add(9000, 4000, 0), "") << "once";
  reset();
  EXPECT_THAT(add(5000, 5000, 0), HasSubstr("but another text: is it the right device?"));
  reset();
  EXPECT_THAT(add(5000, 5000, 0, 100), HasSubstr("with a wrong checksum"));
  watch_ = LinkWatch("MAVLink frame", false, 115200);
  EXPECT_THAT(add(5000, 1000, 0), HasSubstr("another protocol is sent to this port"));
}

TEST_F(LinkWatchTest, ReportsSilenceAndItsEndOnce) {
  std::string text;
  for (int i = 0; i < 200; ++i) text += add(0, 0, 0);
  EXPECT_THAT(text, HasSubstr("nothing received for 5 s"));
  EXPECT_EQ(text.find("nothing"), text.rfind("nothing"));
  EXPECT_EQ(add(50, 50, 1), "it sends again");
}

TEST_F(LinkWatchTest, ReportsTheShareOfWrongChecksumsOnce) {
  std::string text;
  for (int i = 0; i < 100; ++i) text += add(700, 600, 9, 1);
  EXPECT_THAT(text, HasSubstr("100 of 1000 have a wrong checksum"));
  for (int i = 0; i < 100; ++i) EXPECT_EQ(add(700, 600, 9, 1), "");
}

}  // namespace
}  // namespace fiducap
