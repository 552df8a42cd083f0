#include "capture/imu/vehicle_imu.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <random>

#include "base/bytes.hpp"
#include "middleware/mavlink/frame.hpp"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"
#include "unit/capture/imu/mavlink_bytes.hpp"

namespace fiducap::mavlink {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr Instant kBegin = instant_from_ns(800'000'000'000);
constexpr net::Peer kPx4Address{0x0a000002, 14580};
constexpr net::Peer kOtherAddress{0x0a000003, 14580};

/// A vehicle with the replies of PX4 and its own clock, behind a link with delays.
class FakeVehicle {
 public:
  explicit FakeVehicle(std::uint8_t id = 3) : system(id) {}

  std::uint8_t system;
  std::uint8_t autopilot{kPx4};
  Duration booted{kBegin - instant_from_ns(42'000'000'000)};  ///< Our time − its time.
  double drift{50e-6};
  bool answers_timesync{true};
  int asked_for{-1};  ///< Newest message of SET_MESSAGE_INTERVAL …
  double asked_hz{0};
  int streams_asked{0};
  int heartbeats{0};               ///< Received.
  std::optional<Timesync> answer;  ///< To its question.

  [[nodiscard]] std::int64_t clock_ns(Instant now) const {
    const double passed = static_cast<double>((now - kBegin).count()) * (1 + drift);
    return to_ns(kBegin) - booted.count() + static_cast<std::int64_t>(passed);
  }
  template <typename Encode>
  std::vector<std::byte> encoded(Encode encode) {
    std::vector<std::byte> out;
    encode(Sender{system, 1, sequence_++}, out);
    return out;
  }
  std::vector<std::byte> heartbeat() {
    return encoded([&](Sender sender, auto& out) {
      encode_heartbeat(sender, {2, autopilot, kStateActive}, out);
    });
  }
  std::vector<std::byte> timesync_question(std::int64_t ts1_ns) {
    return encoded([&](Sender sender, auto& out) { encode_timesync(sender, {0, ts1_ns}, out); });
  }
  std::vector<std::byte> highres(Instant measured) {
    return inertial(MessageId::kHighresImu, measured, [](LittleEndianWriter& to) {
      for (const float v : {0.1f, 0.2f, -9.8f, 0.01f, 0.02f, 0.03f}) to.f32(v);
      to.zeros(28).u16(0x3f);
    });
  }
  std::vector<std::byte> raw(Instant measured) {
    return inertial(MessageId::kRawImu, measured, [](LittleEndianWriter& to) {
      for (const int v : {0, 0, -1000, 10, 20, 30}) to.i16(static_cast<std::int16_t>(v));
      to.zeros(6);
    });
  }
  /// @return what it answers
  std::vector<std::byte> hear(std::span<const std::byte> bytes, Instant now) {
    std::vector<std::byte> out;
    while (const auto frame = next_frame(bytes)) {
      LittleEndianReader from(frame->payload);
      if (frame->message == 111 && answers_timesync) {
        const Timesync sync = decode_timesync(*frame);
        if (sync.tc1_ns != 0)
          answer = sync;
        else
          encode_timesync({system, 1, sequence_++}, {clock_ns(now), sync.ts1_ns}, out);
      } else if (frame->message == 76) {
        asked_for = static_cast<int>(from.f32());
        asked_hz = 1e6 / static_cast<double>(from.f32());
      } else if (frame->message == 66) {
        ++streams_asked;
      } else if (frame->message == 0) {
        ++heartbeats;
      }
    }
    return out;
  }

 private:
  template <typename Write>
  std::vector<std::byte> inertial(MessageId id, Instant measured, Write write) {
    return encoded([&](Sender sender, auto& out) {
      append_frame(sender, id, out, [&](LittleEndianWriter& to) {
        to.u64(static_cast<std::uint64_t>(clock_ns(measured) / 1000));
        write(to);
      });
    });
  }
  std::uint8_t sequence_{0};
};

class VehicleImuTest : public testing::Test {
 protected:
  /// 200 readings and one heartbeat a second; it replies to our messages.
  void run(Duration how_long, bool sends = true) {
    for (const Instant until = now_ + how_long; now_ < until; now_ += 5ms, ++tick_) {
      if (tick_ % 200 == 0) give(vehicle_.heartbeat(), now_);
      if (sends) {
        const Instant arrived = now_ + 500us + delay();
        give(uses_raw_ ? vehicle_.raw(now_) : vehicle_.highres(now_), arrived);
        collect(now_);
      }
      speak();
    }
  }
  void give(const std::vector<std::byte>& bytes, Instant arrived, net::Peer from = kPx4Address) {
    imu_.receive(bytes, from, arrived);
    while (const auto event = imu_.take_event()) events_ += event->text + "\n";
  }
  void collect(Instant measured) {
    while (const auto sample = imu_.take()) {
      EXPECT_GT(sample->sampled_at, std::exchange(last_, sample->sampled_at));
      newest_ = *sample;
      error_ = sample->sampled_at - measured;
      ++samples_;
    }
  }
  std::vector<std::byte> due() {
    std::vector<std::byte> out;
    imu_.append_due(now_, out);
    return out;
  }
  void speak() {
    const auto out = due();
    while (const auto event = imu_.take_event()) events_ += event->text + "\n";
    const Duration there = 300us + delay();
    const auto answer = vehicle_.hear(out, now_ + there);
    if (!answer.empty()) imu_.receive(answer, kPx4Address, now_ + there + 300us + delay());
  }
  Duration delay() { return from_seconds(late_s_(random_)); }

  MavlinkImuConfig config_;
  VehicleImu imu_{config_};
  FakeVehicle vehicle_;
  Instant now_{kBegin};
  int tick_{0};
  bool uses_raw_{false};
  std::string events_;
  Instant last_{};
  ImuSample newest_;
  Duration error_{};
  int samples_{0};

 private:
  std::mt19937 random_{7};
  std::exponential_distribution<double> late_s_{1 / 0.001};
};

TEST_F(VehicleImuTest, PlacesStampsByTheQuickestRoundTrip) {
  // The quickest of ten round trips with two delays of 1 ms in the mean takes 0.35 ms more than
  // necessary; its error is half the difference of its two delays. The worst of twenty such.
  constexpr Duration kByRoundTrip = 600us;
  run(12s);
  for (int i = 0; i < 200; ++i) {
    run(100ms);
    EXPECT_LT(abs(error_), kByRoundTrip);
  }
  EXPECT_TRUE(imu_.clock_offset(now_));
}

TEST_F(VehicleImuTest, PlacesStampsByTheQuickestArrivalsWithoutReplies) {
  vehicle_.answers_timesync = false;
  run(20s);
  EXPECT_LT(abs(error_ - 500us), 100us);
  EXPECT_EQ(imu_.clock_offset(now_), std::nullopt);
}

TEST_F(VehicleImuTest, FollowsARestartWithinASecond) {
  run(10s);
  vehicle_.drift = 0;
  vehicle_.booted = now_ - instant_from_ns(0);  // its clock is 0 now
  const int before = samples_;
  run(1s);
  EXPECT_GT(samples_ - before, 100);
  run(2s);
  EXPECT_LT(abs(error_), 1500us);
  EXPECT_THAT(events_, HasSubstr("restarted"));
}

TEST_F(VehicleImuTest, RepliesToClockQuestions) {
  run(1s);
  give(vehicle_.timesync_question(7123), now_);
  speak();
  ASSERT_TRUE(vehicle_.answer);
  EXPECT_EQ(vehicle_.answer->tc1_ns, to_ns(now_));
  EXPECT_EQ(vehicle_.answer->ts1_ns, 7123);
}

TEST_F(VehicleImuTest, RequestsReadingsUntilTheyCome) {
  run(1500ms, false);
  EXPECT_EQ(vehicle_.asked_for, 105);
  EXPECT_NEAR(vehicle_.asked_hz, 100, 1e-3);
  EXPECT_GE(vehicle_.heartbeats, 1);
  run(10s, false);
  EXPECT_GT(vehicle_.streams_asked, 0) << "in the form of older autopilots, in turn";
  EXPECT_THAT(events_, HasSubstr("sends no IMU readings on request"));
}

TEST_F(VehicleImuTest, RequestsNothingFromAVehicleThatSends) {
  run(3s);
  vehicle_.asked_for = -1;
  run(30s);
  EXPECT_EQ(vehicle_.asked_for, -1);
  EXPECT_NEAR(imu_.measured_hz(), 200, 2);
  EXPECT_THAT(events_, testing::Not(HasSubstr("requested")));
}

TEST_F(VehicleImuTest, UsesRawReadingsOfArduPilotOnly) {
  uses_raw_ = true;
  run(2s);
  EXPECT_EQ(samples_, 0) << "of unknown unit";
  EXPECT_GT(imu_.counts().other_message, 0u);
  vehicle_ = FakeVehicle();
  imu_ = VehicleImu(config_);
  tick_ = 0;
  vehicle_.autopilot = kArduPilot;
  run(900ms, false);
  EXPECT_EQ(vehicle_.asked_for, 105);
  run(1s, false);
  EXPECT_EQ(vehicle_.asked_for, 27);
  run(1s);
  EXPECT_NEAR(newest_.f_B.z(), 9.80665, 1e-9);
  EXPECT_NEAR(newest_.w_WB_B.z(), -0.03, 1e-9);
}

TEST_F(VehicleImuTest, PrefersTheBetterMessageWhileItComes) {
  vehicle_.autopilot = kArduPilot;
  uses_raw_ = true;
  run(1s);
  uses_raw_ = false;
  run(1s);
  const int before = samples_;
  give(vehicle_.raw(now_), now_ + 1ms);
  collect(now_);
  EXPECT_EQ(samples_, before) << "while HIGHRES_IMU comes";
  uses_raw_ = true;
  run(3s);
  EXPECT_GT(samples_, before + 300);
}

TEST_F(VehicleImuTest, DropsCountsAndNamesASecondVehicle) {
  run(1s);
  const int before = samples_;
  FakeVehicle other(9);
  for (int i = 0; i < 100; ++i) {
    give(other.heartbeat(), now_, kOtherAddress);
    give(other.highres(now_), now_, kOtherAddress);
  }
  EXPECT_EQ(imu_.choice().foreign(), 200u);
  EXPECT_THAT(events_, HasSubstr("another vehicle, system 9 at 10.0.0.3:14580"));
  collect(now_);
  EXPECT_EQ(samples_, before);
  EXPECT_EQ(imu_.address(now_), kPx4Address) << "messages go to the first one only";
}

TEST_F(VehicleImuTest, DistinguishesVehiclesOfOneIdByAddress) {
  run(1s);
  const int before = samples_;
  FakeVehicle twin;
  for (int i = 0; i < 100; ++i) give(twin.highres(now_), now_, kOtherAddress);
  collect(now_);
  EXPECT_EQ(samples_, before);
  EXPECT_THAT(events_, HasSubstr("same id"));
}

TEST_F(VehicleImuTest, ChangesToAnotherVehicleWhenTheFirstIsSilent) {
  run(1s);
  now_ += 11s;
  FakeVehicle other(9);
  give(other.highres(now_), now_, kOtherAddress);
  collect(now_);
  EXPECT_EQ(imu_.address(now_), kOtherAddress);
  EXPECT_THAT(events_, HasSubstr("uses the IMU of system 9 at 10.0.0.3:14580"));
}

TEST_F(VehicleImuTest, ProvesAnAddressOnlyByAReply) {
  give(vehicle_.heartbeat(), now_);
  const auto asked = due();
  EXPECT_FALSE(imu_.is_proven(now_)) << "a sender address may be forged";
  give(vehicle_.encoded([&](Sender from, auto& to) {
    encode_timesync(from, {1, to_ns(now_)}, to);
  }),
       now_ + 1ms);
  EXPECT_FALSE(imu_.is_proven(now_ + 1ms)) << "our clock can be guessed";
  give(vehicle_.hear(asked, now_ + 1ms), now_ + 2ms);
  EXPECT_TRUE(imu_.is_proven(now_ + 2ms));
  EXPECT_FALSE(imu_.is_proven(now_ + 13s)) << "for a time only";
}

TEST_F(VehicleImuTest, ReplacesAForgerByTheRealAutopilot) {
  FakeVehicle forger;
  const auto forge = [&] { give(forger.highres(now_), now_, kOtherAddress); };
  forge();
  ASSERT_EQ(imu_.address(now_), kOtherAddress);
  std::vector<std::byte> question;
  for (int i = 0; i < 3; ++i, now_ += 5ms) {
    forge();
    (void)imu_.challenge(now_, question);  // goes to an address that does not answer
    forge();
    give(vehicle_.highres(now_), now_);
    question.clear();
    const auto to = imu_.challenge(now_, question);
    if (!to) break;
    EXPECT_EQ(*to, kPx4Address);
    give(vehicle_.hear(question, now_ + 1ms), now_ + 2ms);
  }
  EXPECT_EQ(imu_.address(now_), kPx4Address);
  run(1s);
  EXPECT_TRUE(imu_.is_proven(now_));
  forge();
  EXPECT_EQ(imu_.challenge(now_, question), std::nullopt);
  EXPECT_EQ(imu_.address(now_), kPx4Address);
}

TEST_F(VehicleImuTest, ProvesNothingByAReplyFromAnotherAddress) {
  give(vehicle_.heartbeat(), now_);
  FakeVehicle forger;
  give(forger.heartbeat(), now_, kOtherAddress);
  std::vector<std::byte> question;
  ASSERT_EQ(imu_.challenge(now_, question), kOtherAddress);
  constexpr net::Peer kThirdAddress{0x0a000004, 14580};
  give(forger.hear(question, now_), now_, kThirdAddress);
  give(forger.heartbeat(), now_, kThirdAddress);
  EXPECT_EQ(imu_.address(now_), kPx4Address);
}

TEST_F(VehicleImuTest, WaitsForTheConfiguredVehicle) {
  config_.system = 9;
  imu_ = VehicleImu(config_);
  run(2s);
  EXPECT_EQ(samples_, 0);
  EXPECT_THAT(events_, HasSubstr("another vehicle, system 3"));
  FakeVehicle wanted(9);
  give(wanted.highres(now_), now_, kOtherAddress);
  collect(now_);
  EXPECT_EQ(samples_, 1);
}

TEST_F(VehicleImuTest, IgnoresGroundStationsAndCompanions) {
  std::vector<std::byte> out;
  encode_heartbeat({255, 190, 0}, {6, kNoAutopilot, kStateActive}, out);
  give(out, now_);
  EXPECT_EQ(imu_.address(now_), std::nullopt);
  EXPECT_EQ(due().size(), 21u) << "a heartbeat and nothing else";
}

TEST_F(VehicleImuTest, BoundsItsRepliesToManyQuestions) {
  run(1s);
  std::vector<std::byte> questions;
  for (int i = 0; i < 500; ++i)
    std::ranges::copy(vehicle_.timesync_question(i + 1), std::back_inserter(questions));
  give(questions, now_);
  EXPECT_LT(due().size(), 700u);
}

TEST_F(VehicleImuTest, AllocatesNothingPerReadingAfterWarmUp) {
  run(5s);
  const auto frame = vehicle_.highres(now_);
  const AllocationCounter allocations;
  imu_.receive(frame, kPx4Address, now_ + 1ms);
  EXPECT_TRUE(imu_.take());
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace fiducap::mavlink
