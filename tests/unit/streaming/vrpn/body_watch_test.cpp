#include "streaming/vrpn/body_watch.hpp"

#include <gtest/gtest.h>

#include "streaming/vrpn/codec.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vrpn {
namespace {

class BodyWatchTest : public testing::Test {
 protected:
  /// One frame 10 ms after the last. @return the texts, with their sender.
  std::vector<std::pair<std::int32_t, TextMessage>> observe(bool a_valid, bool b_valid = true) {
    auto frame = make_scene_frame({"a", "b"}, ++number_);
    frame->bodies[0].valid = a_valid;
    frame->bodies[1].valid = b_valid;
    bytes_.emplace_back();
    watch_.observe(*frame, senders_, bytes_.back());
    std::vector<std::pair<std::int32_t, TextMessage>> texts;
    for (std::span<const std::byte> rest(bytes_.back()); !rest.empty();) {
      const auto message = decode_message(rest);
      EXPECT_TRUE(message);
      EXPECT_EQ(message->header.type, 15);
      texts.emplace_back(message->header.sender, *decode_text(message->payload));
      rest = rest.subspan(message->size);
    }
    return texts;
  }

  BodyWatch watch_;
  std::vector<std::int32_t> senders_{1, 2};
  std::uint64_t number_{0};
  std::vector<std::vector<std::byte>> bytes_;  // texts point into them
};

TEST_F(BodyWatchTest, WarnsOnceWhenABodyIsLost) {
  EXPECT_TRUE(observe(true).empty());
  const auto texts = observe(false);
  ASSERT_EQ(texts.size(), 1u);
  EXPECT_EQ(texts[0].first, 1);
  EXPECT_EQ(texts[0].second.severity, Severity::kWarning);
  for (int i = 0; i < 500; ++i) EXPECT_TRUE(observe(false).empty());
}

TEST_F(BodyWatchTest, SaysWhenItIsBackWithoutWarning) {
  observe(true);
  observe(false);
  number_ += 100;  // a second later
  const auto texts = observe(true);
  ASSERT_EQ(texts.size(), 1u);
  EXPECT_EQ(texts[0].second.severity, Severity::kNormal);
}

TEST_F(BodyWatchTest, SaysNothingOfABodyThatWasNeverSeen) {
  for (int i = 0; i < 300; ++i) EXPECT_TRUE(observe(false).empty());
}

TEST_F(BodyWatchTest, SaysAtMostOneThingPerSecondAndBody) {
  observe(true);
  std::size_t texts = 0;
  for (int i = 0; i < 500; ++i) texts += observe(i % 2 == 0).size();  // 5 s of flicker
  EXPECT_GE(texts, 3u);
  EXPECT_LE(texts, 6u);
}

TEST_F(BodyWatchTest, IgnoresBodiesThatAreNotServed) {
  senders_ = {-1, 2};
  observe(true);
  EXPECT_TRUE(observe(false).empty());
}

}  // namespace
}  // namespace fiducap::vrpn
