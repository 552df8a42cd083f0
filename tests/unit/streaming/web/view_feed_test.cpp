#include "streaming/web/view_feed.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "support/fake_views.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using Kind = ViewAccess::Kind;

constexpr net::Peer kHere{0x7f000001, 5};
constexpr net::Peer kElsewhere{0x0a000001, 5};

class ViewFeedTest : public testing::Test {
 protected:
  std::shared_ptr<ViewConnection> join(const net::Peer& peer = kHere) {
    return feed_.join(peer, start_, nullptr);
  }
  /// All messages that are sent at this time.
  static std::vector<std::string> sent(ViewConnection& viewer, Instant now) {
    std::vector<std::string> all;
    while (const Message message = viewer.next(now)) {
      all.push_back(*message);
      viewer.written();
    }
    return all;
  }
  void request(ViewConnection& viewer, std::string_view text) {
    feed_.request(viewer, parse_view_requests(text).value());
  }
  /// @return how many have been dismissed
  static std::ptrdiff_t dismissed(const std::vector<std::shared_ptr<ViewConnection>>& viewers) {
    return std::count_if(viewers.begin(), viewers.end(),
                         [](const auto& one) { return one->dismissed(); });
  }
  /// How many of the pictures, one of each camera per period, a viewer gets.
  std::size_t received(ViewConnection& viewer, int pictures, Duration period) {
    std::size_t count = 0;
    for (int i = 0; i < pictures; ++i) {
      for (std::size_t camera = 0; camera < views_.all.size(); ++camera) views_.make(camera, "x");
      feed_.tick(start_ + i * period);
      count += sent(viewer, start_ + i * period).size();
    }
    return count;
  }
  ViewAccess access(ViewRule rule, const net::Peer& peer, bool proxy = false, bool token = true) {
    return ViewFeed(rule, &views_).access(peer, proxy, token);
  }

  Instant start_ = instant_from_ns(1'000'000'000);
  FakeViews views_;
  ViewFeed feed_{ViewRule::kOperator, &views_};
};

TEST_F(ViewFeedTest, AccessFollowsTheRule) {
  EXPECT_EQ(access(ViewRule::kOff, kHere).kind, Kind::kDenied);
  EXPECT_EQ(access(ViewRule::kLoopback, kHere).kind, Kind::kGranted);
  EXPECT_EQ(access(ViewRule::kLoopback, kElsewhere).kind, Kind::kDenied);
  EXPECT_EQ(access(ViewRule::kOperator, kHere).kind, Kind::kGranted);
  EXPECT_EQ(access(ViewRule::kOperator, kElsewhere).kind, Kind::kProof);
  EXPECT_EQ(access(ViewRule::kEveryone, kElsewhere).kind, Kind::kGranted);
  EXPECT_EQ(access(ViewRule::kLoopback, kHere, true).kind, Kind::kDenied) << "a local proxy";
  EXPECT_EQ(access(ViewRule::kOperator, kHere, true).kind, Kind::kProof);
  EXPECT_EQ(ViewFeed(ViewRule::kEveryone, nullptr).access(kHere, false, true).kind, Kind::kDenied);
  for (const ViewRule rule : {ViewRule::kOff, ViewRule::kLoopback})
    EXPECT_THAT(access(rule, kElsewhere).why, HasSubstr("streaming.web.camera_views"));
  const auto without_token = access(ViewRule::kOperator, kElsewhere, false, false);
  EXPECT_EQ(without_token.kind, Kind::kDenied);
  EXPECT_THAT(without_token.why, HasSubstr("operator.token"));
}

TEST_F(ViewFeedTest, RequestsNothingWithoutViewersOfACamera) {
  const auto viewer = join();
  EXPECT_EQ(views_.asked, 0);
  views_.make(0, "old");
  feed_.tick(start_);
  EXPECT_TRUE(sent(*viewer, start_).empty());
  request(*viewer, "9/0/640/10/0 1/7/640/10/0");
  EXPECT_EQ(views_.asked, 0) << "these cameras do not exist";
  request(*viewer, "1/0/640/10/0");
  request(*viewer, "1/0/640/10/0");
  EXPECT_EQ(views_.asked, 1) << "nothing has changed";
}

TEST_F(ViewFeedTest, PicturesReachTheirRequesters) {
  const auto one = join(), other = join(kElsewhere);
  request(*one, "1/0/640/10/0 2/0/640/10/0");
  request(*other, "2/0/640/10/0");
  views_.make(0, "first");
  views_.make(2, "third");
  feed_.tick(start_);
  EXPECT_EQ(sent(*one, start_), (std::vector<std::string>{"first", "third"}));
  EXPECT_EQ(sent(*other, start_), std::vector<std::string>{"third"});
}

TEST_F(ViewFeedTest, LargestRequestHoldsUntilTheLastViewerLeaves) {
  const auto one = join(), other = join(kElsewhere);
  request(*one, "1/1/640/2/0");
  EXPECT_EQ(views_.watched[1], (ViewRequest{640, 2, false}));
  request(*other, "1/1/320/10/1");
  EXPECT_EQ(views_.watched[1], (ViewRequest{640, 10, true}));
  feed_.leave(*other);
  EXPECT_EQ(views_.watched[1], (ViewRequest{640, 2, false}));
  request(*one, "");
  EXPECT_FALSE(views_.watched[1].has_value());
  EXPECT_FALSE(views_.watched.contains(0));
}

TEST_F(ViewFeedTest, LimitsViewersPerAddressAndInAll) {
  std::vector<std::shared_ptr<ViewConnection>> all;
  for (std::size_t i = 0; i < ViewFeed::kMostPerAddress; ++i) {
    ASSERT_TRUE(feed_.has_place(kHere));
    all.push_back(join());
  }
  EXPECT_FALSE(feed_.has_place(kHere)) << "the limit of this address";
  for (std::size_t i = ViewFeed::kMostPerAddress; i < ViewFeed::kMostViewers; ++i) {
    const net::Peer peer(static_cast<std::uint32_t>(0x0a000001 + i), 5);
    ASSERT_TRUE(feed_.has_place(peer));
    all.push_back(join(peer));
  }
  (void)join(kElsewhere);
  EXPECT_EQ(dismissed(all), 1);
  EXPECT_TRUE(all[ViewFeed::kMostPerAddress - 1]->dismissed())
      << "the newest of the address with most";
}

TEST_F(ViewFeedTest, LocalViewerReplacesOneOfTheAddressWithMost) {
  std::vector<std::shared_ptr<ViewConnection>> all;
  for (std::size_t i = 0; i < ViewFeed::kMostViewers; ++i)
    all.push_back(join({static_cast<std::uint32_t>(0x0a000001 + i % 2), 5}));
  EXPECT_TRUE(feed_.has_place(kHere));
  EXPECT_FALSE(join()->dismissed());
  EXPECT_EQ(dismissed(all), 1);
}

TEST_F(ViewFeedTest, SlowReaderGetsTheNewestAndLosesTheRest) {
  const auto viewer = join();
  request(*viewer, "1/0/640/10/0");
  Instant now = start_;
  views_.make(0, "1");
  feed_.tick(now);
  ASSERT_TRUE(viewer->next(now));  // not written yet
  for (int i = 2; i <= 5; ++i) {
    now += 100ms;
    views_.make(0, std::to_string(i));
    feed_.tick(now);
    EXPECT_FALSE(viewer->next(now));
  }
  EXPECT_TRUE(viewer->is_stuck(now, 300ms));
  EXPECT_FALSE(viewer->is_stuck(now, 500ms));
  viewer->written();
  EXPECT_EQ(sent(*viewer, now), std::vector<std::string>{"5"});
  EXPECT_EQ(viewer->status(now).frames_sent, 2u);
  EXPECT_EQ(viewer->status(now).frames_dropped, 3u);
  EXPECT_EQ(viewer->status(now).detail, "camera views, 1 camera");
}

TEST_F(ViewFeedTest, LimitsTheRateOfACamera) {
  const auto viewer = join();
  request(*viewer, "1/0/640/2/0");
  EXPECT_EQ(received(*viewer, 40, 50ms), 4u);
}

TEST_F(ViewFeedTest, LimitsTheRateOfAllCamerasTogether) {
  views_.all.clear();
  std::string text;
  for (int i = 0; i < 16; ++i) {
    views_.all.push_back({i, 0, 752, 480, 20});
    text += (i > 0 ? " " : "") + std::to_string(i) + "/0/320/10/0";
  }
  const auto viewer = join();
  request(*viewer, text);
  const auto count = received(*viewer, 100, 100ms);
  EXPECT_LE(count, static_cast<std::size_t>(ViewConnection::kMostPerSecond) * 11);
  EXPECT_GT(count, 250u);
}

}  // namespace
}  // namespace fiducap::web
