// The path of a frame: publisher, mailbox, the I/O loop and its signals.
#include "daemon/stream_loop.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <csignal>
#include <stdexcept>
#include <thread>

#include "daemon/config/sockets.hpp"
#include "daemon/publisher.hpp"
#include "middleware/net/listening_ports.hpp"
#include "support/allocation_counter.hpp"
#include "support/fake_clock.hpp"
#include "support/fake_operator_api.hpp"
#include "support/results.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {
namespace {

using testing::ElementsAre;

constexpr Instant publish_ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

/// A publisher at 100 Hz whose frames are kept; the receiver stops it.
class PublisherTest : public testing::Test {
 protected:
  /// @param delay_ms  of the receiver, per frame
  void publish(std::vector<int> delay_ms) {
    Publisher publisher(100, scene_, map_, clock_, [&](std::shared_ptr<const SceneFrame> frame) {
      at_.push_back(frame->at);
      numbers_.push_back(frame->number);
      rate_hz_ = frame->rate_hz;
      clock_.advance(std::chrono::milliseconds(delay_ms[at_.size() - 1]));
      if (at_.size() == delay_ms.size()) stop_.request_stop();
    });
    publisher.run(stop_.get_token());
    missed_ = publisher.missed();
    published_ = publisher.frames();
  }

  FakeClock clock_{publish_ms(1000)};
  Scene scene_{{{{1, "robot"}, Pose{}, BodyLimits{}, BodySensors{}, EstimatorConfig{}, {}}}};
  MapBuilder map_{MapConfig{}, TagMap{}};
  std::stop_source stop_;
  std::vector<Instant> at_;
  std::vector<std::uint64_t> numbers_;
  double rate_hz_{};
  std::uint64_t missed_{};
  std::uint64_t published_{};
};

TEST_F(PublisherTest, TicksAtItsRateAlsoAfterALateOne) {
  publish({0, 7, 0, 0});
  EXPECT_EQ(missed_, 0u);
  EXPECT_EQ(rate_hz_, 100);
  EXPECT_THAT(at_,
              ElementsAre(publish_ms(1000), publish_ms(1010), publish_ms(1020), publish_ms(1030)));
}

TEST_F(PublisherTest, OmitsMissedTicksAndNumbersFramesWithoutGaps) {
  publish({0, 25, 0});
  EXPECT_THAT(at_, ElementsAre(publish_ms(1000), publish_ms(1010), publish_ms(1040)));
  EXPECT_EQ(missed_, 2u);
  EXPECT_THAT(numbers_, ElementsAre(1u, 2u, 3u));
  EXPECT_EQ(published_, 3u);
}

class FrameMailboxTest : public testing::Test {
 protected:
  void put(std::uint64_t number) { mailbox_.put(make_scene_frame({"robot"}, number)); }

  boost::asio::io_context io_;
  std::vector<std::uint64_t> received_;
  FrameMailbox mailbox_{io_, [this](const auto& frame) { received_.push_back(frame->number); }};
};

TEST_F(FrameMailboxTest, KeepsOnlyTheNewestFrameForTheIoThread) {
  for (std::uint64_t number = 1; number <= 5; ++number) put(number);
  EXPECT_TRUE(received_.empty());
  io_.poll();
  EXPECT_THAT(received_, ElementsAre(5));
}

TEST_F(FrameMailboxTest, ReleasesAReplacedFrame) {
  auto first = make_scene_frame({"robot"}, 1);
  const std::weak_ptr<const SceneFrame> watched = first;
  mailbox_.put(std::move(first));
  put(2);
  EXPECT_TRUE(watched.expired());
}

TEST_F(FrameMailboxTest, DeliversNothingAfterItWasClosed) {
  put(1);
  mailbox_.close();
  io_.poll();
  EXPECT_TRUE(received_.empty());
}

TEST_F(FrameMailboxTest, AllocatesNothingPerFrameAfterWarmUp) {
  const std::shared_ptr<const SceneFrame> frame = make_scene_frame({"robot"});
  received_.reserve(1000);
  const auto deliver = [&](int frames) {
    for (int i = 0; i < frames; ++i) {
      mailbox_.put(frame);
      io_.poll();
    }
  };
  deliver(10);
  const AllocationCounter allocations;
  deliver(100);
  EXPECT_EQ(allocations.count(), 0u);
  EXPECT_EQ(received_.size(), 110u);
}

TEST_F(FrameMailboxTest, DeliversInOrderAndTheLastFrameBetweenThreads) {
  constexpr std::uint64_t kFrames = 20'000;
  const std::jthread publisher([&] {
    for (std::uint64_t number = 1; number <= kFrames; ++number) put(number);
  });
  while (received_.empty() || received_.back() != kFrames) io_.run_one();
  EXPECT_TRUE(std::is_sorted(received_.begin(), received_.end()));
  EXPECT_EQ(std::adjacent_find(received_.begin(), received_.end()), received_.end());
}

/// Records its calls, in order.
class RecordingStreamer final : public Streamer {
 public:
  explicit RecordingStreamer(std::string& calls) : Streamer("test"), calls_(calls) {}
  void publish(const std::shared_ptr<const SceneFrame>&) override { calls_ += 'p'; }
  void append_clients(std::vector<ClientStatus>&) const override {}
  void stop() override { calls_ += 's'; }

 private:
  std::string& calls_;
};

TEST(StreamLoop, ContinuesAfterAnException) {
  std::string calls;
  StreamLoop loop("test");
  boost::asio::post(loop.io(), [] { throw std::runtime_error("a defect"); });
  boost::asio::post(loop.io(), [&] { calls += 'x'; });
  loop.hub().add(std::make_unique<RecordingStreamer>(calls));
  loop.on_delivered([&](const auto&) { loop.stop(); });
  std::jthread publisher([&] { loop.put(make_scene_frame({"robot"})); });
  loop.run();
  EXPECT_EQ(calls, "xps");
}

// Requests of pages do not delay frames of other protocols.
TEST(ProtocolServers, ServePagesOnAThreadOfTheirOwn) {
  for (const std::string only : {"web", "vrpn"}) {
    SCOPED_TRACE(only);
    ServerConfig config;
    for_each_protocol([&](std::string_view name, auto& one) { one.enabled = name == only; },
                      config.streaming);
    config.streaming.web.port = config.streaming.vrpn.port = 0;
    FakeOperatorApi operator_api;
    const EventBoard events{[] { return std::int64_t{0}; }};
    const FakeClock clock;
    StreamLoop frames("frames");
    StreamLoop pages("pages");
    (void)value_of(start_protocols(
        {frames, pages, config, std::make_shared<SceneModel>(), operator_api, events, clock, {}}));
    EXPECT_EQ(frames.hub().empty(), only == "web");
    EXPECT_EQ(pages.hub().empty(), only == "vrpn");
  }
}

// Whatever protocol is added: its `served()` tells its sockets.
TEST(ProtocolServers, OpenTheSocketsThatAreListed) {
  const std::string address = "127.45.0.1";    // of no other program
  constexpr std::uint16_t kFirstFree = 32768;  // the kernel's choice for port 0
  ServerConfig config;
  for_each_protocol(
      [&](std::string_view name, auto& one) {
        one.enabled = name != "dds";
        if constexpr (requires { one.address; }) one.address = address;
      },
      config.streaming);
  config.streaming.vicon.port = 1801;  // 801 needs a permission
  config.streaming.mavlink.port = 14550;
  FakeOperatorApi operator_api;
  const EventBoard events{[] { return std::int64_t{0}; }};
  const FakeClock clock;
  StreamLoop frames("frames");
  StreamLoop pages("pages");
  (void)value_of(start_protocols(
      {frames, pages, config, std::make_shared<SceneModel>(), operator_api, events, clock, {}}));
  std::vector<std::string> open;
  for (const net::ListeningPort& one : net::listening_ports())
    if (one.address == address && one.port < kFirstFree)
      open.push_back(text_of(PortUse{one.port, one.transport == net::Transport::kUdp}));
  std::vector<std::string> listed;
  for (const OwnSocket& one : sockets_of(config)) listed.push_back(text_of(one.port));
  EXPECT_THAT(open, testing::UnorderedElementsAreArray(listed));
}

class SignalWaitTest : public testing::Test {
 protected:
  /// @return number of stops by one SIGTERM
  int stops_by_a_signal() {
    stops_ = 0;
    std::raise(SIGTERM);
    io_.restart();
    while (stops_ == 0 && io_.run_one() > 0) {
    }
    return stops_;
  }

  int stops_{0};
  boost::asio::io_context io_;
  std::shared_ptr<SignalWait> wait_ = std::make_shared<SignalWait>(io_, [this] { ++stops_; });
};

TEST_F(SignalWaitTest, HandlesEverySignal) {
  wait_->resume();
  wait_->resume();  // waits already
  EXPECT_EQ(stops_by_a_signal(), 1);
  EXPECT_EQ(stops_by_a_signal(), 1);
}

TEST_F(SignalWaitTest, ResumesAfterFailedAllocations) {
  net::register_wait(io_, wait_);
  AllocationFault::reach_this_thread();
  bool has_failed = true;
  int failures = 0;
  for (int nth = 1; has_failed; ++nth) {
    AllocationFault::arm(nth);
    try {
      wait_->resume();
    } catch (const std::bad_alloc&) {
      ++failures;
    }
    has_failed = AllocationFault::disarm();
  }
  EXPECT_GT(failures, 0);
  EXPECT_TRUE(net::resume_waits(io_));
  EXPECT_EQ(stops_by_a_signal(), 1);
}

}  // namespace
}  // namespace fiducap
