#include "streaming/streamer.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace fiducap {
namespace {

/// Counts frames and requests for its one client.
class Counter final : public Streamer {
 public:
  struct Counts {
    int frames{0};
    int requests{0};
    bool throws{false};
  };
  explicit Counter(Counts& counts) : Streamer("test"), counts_(counts) {}
  void publish(const std::shared_ptr<const SceneFrame>&) override {
    if (counts_.throws) throw std::runtime_error("cannot be encoded");
    ++counts_.frames;
  }
  void append_clients(std::vector<ClientStatus>& out) const override {
    ++counts_.requests;
    out.push_back({"test", "peer", "", 0, 0, 0});
  }
  void stop() override {}

 private:
  Counts& counts_;
};

TEST(StreamHub, ProtocolThatThrowsStopsNoOther) {
  Counter::Counts before, broken{.throws = true}, after;
  StreamHub hub;
  for (auto* counts : {&before, &broken, &after}) hub.add(std::make_unique<Counter>(*counts));
  for (int i = 0; i < 3; ++i) hub.publish(nullptr);
  EXPECT_EQ(before.frames, 3);
  EXPECT_EQ(after.frames, 3);
}

TEST(StreamHub, ReportsItsClientsWithTheFrameAfterARequest) {
  Counter::Counts counts;
  StreamHub hub;
  hub.add(std::make_unique<Counter>(counts));
  hub.publish(nullptr);
  EXPECT_EQ(counts.requests, 0);
  EXPECT_TRUE(hub.shown_clients()->empty());
  hub.publish(nullptr);
  hub.publish(nullptr);
  EXPECT_EQ(counts.requests, 1);
  EXPECT_EQ(hub.shown_clients()->size(), 1u);
}

}  // namespace
}  // namespace fiducap
