#include "streaming/streamer.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace fiducap {
namespace {

class Counter final : public Streamer {
 public:
  Counter(int& frames, bool throws) : frames_(frames), throws_(throws) {}
  [[nodiscard]] std::string_view protocol() const override { return "test"; }
  void publish(const std::shared_ptr<const SceneFrame>&) override {
    if (throws_) throw std::runtime_error("cannot be encoded");
    ++frames_;
  }
  void append_clients(std::vector<ClientStatus>&) const override {}
  void stop() override {}

 private:
  int& frames_;
  bool throws_;
};

TEST(StreamHub, AProtocolThatThrowsSilencesNoOther) {
  int before = 0;
  int broken = 0;
  int after = 0;
  StreamHub hub;
  hub.add(std::make_unique<Counter>(before, false));
  hub.add(std::make_unique<Counter>(broken, true));
  hub.add(std::make_unique<Counter>(after, false));
  for (int i = 0; i < 3; ++i) hub.publish(nullptr);
  EXPECT_EQ(before, 3);
  EXPECT_EQ(after, 3);
}

class OneClient final : public Streamer {
 public:
  explicit OneClient(int& asked) : asked_(asked) {}
  [[nodiscard]] std::string_view protocol() const override { return "test"; }
  void publish(const std::shared_ptr<const SceneFrame>&) override {}
  void append_clients(std::vector<ClientStatus>& out) const override {
    ++asked_;
    out.push_back({"test", "peer", "", 0, 0, 0});
  }
  void stop() override {}

 private:
  int& asked_;
};

TEST(StreamHub, ShowsItsClientsToAnotherThreadWithTheNextFrame) {
  int asked = 0;
  StreamHub hub;
  hub.add(std::make_unique<OneClient>(asked));
  hub.publish(nullptr);
  EXPECT_EQ(asked, 0) << "nobody wants to know";
  EXPECT_TRUE(hub.shown_clients()->empty());
  hub.publish(nullptr);
  hub.publish(nullptr);
  EXPECT_EQ(asked, 1) << "once per question";
  EXPECT_EQ(hub.shown_clients()->size(), 1u);
}

}  // namespace
}  // namespace fiducap
