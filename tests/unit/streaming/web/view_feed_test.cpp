#include "streaming/web/view_feed.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/fake_views.hpp"

namespace fiducap::web {
namespace {

using namespace std::chrono_literals;
using Kind = ViewAccess::Kind;

constexpr net::Peer kHere{0x7f000001, 5};
constexpr net::Peer kElsewhere{0x0a000001, 5};

class ViewFeedTest : public testing::Test {
 protected:
  std::shared_ptr<ViewConnection> join(const net::Peer& peer = kHere) {
    return feed_.join(peer, start_, nullptr);
  }
  /// What is sent until nothing waits, at this time.
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
  Kind access(ViewRule rule, const net::Peer& peer, bool proxy = false, bool token = true) {
    return ViewFeed(rule, &views_).access(peer, proxy, token).kind;
  }

  Instant start_ = instant_from_ns(1'000'000'000);
  FakeViews views_;
  ViewFeed feed_{ViewRule::kOperator, &views_};
};

TEST_F(ViewFeedTest, WhoMayLook) {
  EXPECT_EQ(access(ViewRule::kOff, kHere), Kind::kDenied);
  EXPECT_EQ(access(ViewRule::kLoopback, kHere), Kind::kGranted);
  EXPECT_EQ(access(ViewRule::kLoopback, kElsewhere), Kind::kDenied);
  EXPECT_EQ(access(ViewRule::kOperator, kHere), Kind::kGranted);
  EXPECT_EQ(access(ViewRule::kOperator, kElsewhere), Kind::kProof);
  EXPECT_EQ(access(ViewRule::kOperator, kElsewhere, false, false), Kind::kDenied) << "no token";
  EXPECT_EQ(access(ViewRule::kEveryone, kElsewhere), Kind::kGranted);
}

TEST_F(ViewFeedTest, AProxyOnThisMachineIsNotThisMachine) {
  EXPECT_EQ(access(ViewRule::kLoopback, kHere, true), Kind::kDenied);
  EXPECT_EQ(access(ViewRule::kOperator, kHere, true), Kind::kProof);
}

TEST_F(ViewFeedTest, SaysWhatToDoForThoseWhoMayNot) {
  for (const ViewRule rule : {ViewRule::kOff, ViewRule::kLoopback}) {
    const std::string why = ViewFeed(rule, &views_).access(kElsewhere, false, true).why;
    EXPECT_NE(why.find("streaming.web.camera_views"), std::string::npos) << why;
  }
  const std::string why = feed_.access(kElsewhere, false, false).why;
  EXPECT_NE(why.find("operator.token"), std::string::npos) << why;
  EXPECT_EQ(ViewFeed(ViewRule::kEveryone, nullptr).access(kHere, false, true).kind, Kind::kDenied);
}

TEST_F(ViewFeedTest, EncodesNothingWithoutRequests) {
  const auto viewer = join();
  EXPECT_EQ(views_.asked, 0);
  views_.make(0, "old");
  feed_.tick(start_);
  EXPECT_TRUE(sent(*viewer, start_).empty());
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

TEST_F(ViewFeedTest, TheLargestRequestCountsAndTheLastOneEndsTheView) {
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

TEST_F(ViewFeedTest, AsksOnlyForWhatChanges) {
  const auto one = join();
  request(*one, "1/0/640/10/0");
  request(*one, "1/0/640/10/0");
  EXPECT_EQ(views_.asked, 1);
}

TEST_F(ViewFeedTest, ACameraThatDoesNotExistGivesNothing) {
  const auto one = join();
  request(*one, "9/0/640/10/0 1/7/640/10/0");
  EXPECT_EQ(views_.asked, 0);
}

TEST_F(ViewFeedTest, PlacesAreBounded) {
  std::vector<std::shared_ptr<ViewConnection>> all;
  for (std::size_t i = 0; i < ViewFeed::kMostPerAddress; ++i) {
    ASSERT_TRUE(feed_.has_place(kHere));
    all.push_back(join());
  }
  EXPECT_FALSE(feed_.has_place(kHere)) << "this address has enough";
  for (std::size_t i = ViewFeed::kMostPerAddress; i < ViewFeed::kMostViewers; ++i) {
    const net::Peer peer(static_cast<std::uint32_t>(0x0a000001 + i), 5);
    ASSERT_TRUE(feed_.has_place(peer));
    all.push_back(join(peer));
  }
  (void)join(kElsewhere);
  const auto dismissed = [](const auto& one) { return one->dismissed(); };
  EXPECT_EQ(std::count_if(all.begin(), all.end(), dismissed), 1);
  EXPECT_TRUE(all[ViewFeed::kMostPerAddress - 1]->dismissed()) << "the newest of who has most";
}

TEST_F(ViewFeedTest, TheMachineItselfGetsAPlaceOfWhoHasMost) {
  std::vector<std::shared_ptr<ViewConnection>> all;
  for (std::size_t i = 0; i < ViewFeed::kMostViewers; ++i)
    all.push_back(join({static_cast<std::uint32_t>(0x0a000001 + i % 2), 5}));
  EXPECT_TRUE(feed_.has_place(kHere));
  EXPECT_FALSE(join()->dismissed());
  const auto dismissed = [](const auto& one) { return one->dismissed(); };
  EXPECT_EQ(std::count_if(all.begin(), all.end(), dismissed), 1);
}

TEST_F(ViewFeedTest, ASlowReaderGetsTheNewestAndLosesTheRest) {
  const auto viewer = join();
  request(*viewer, "1/0/640/10/0");
  Instant now = start_;
  views_.make(0, "1");
  feed_.tick(now);
  ASSERT_TRUE(viewer->next(now));  // … and is not written yet
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

TEST_F(ViewFeedTest, ACameraComesNoFasterThanWished) {
  const auto viewer = join();
  request(*viewer, "1/0/640/2/0");
  std::size_t came = 0;
  for (int i = 0; i < 40; ++i) {  // 20 Hz for two seconds
    const Instant now = start_ + i * 50ms;
    views_.make(0, "x");
    feed_.tick(now);
    came += sent(*viewer, now).size();
  }
  EXPECT_EQ(came, 4u);
}

TEST_F(ViewFeedTest, AllCamerasTogetherComeNoFasterThanTheBound) {
  const auto viewer = join();
  views_.all.clear();
  for (int i = 0; i < 16; ++i) views_.all.push_back({i, 0, 752, 480, 20});
  feed_.leave(*viewer);
  const auto other = join();
  std::string text;
  for (int i = 0; i < 16; ++i) text += (i > 0 ? " " : "") + std::to_string(i) + "/0/320/10/0";
  request(*other, text);
  std::size_t came = 0;
  for (int i = 0; i < 100; ++i) {  // ten seconds
    const Instant now = start_ + i * 100ms;
    for (std::size_t k = 0; k < 16; ++k) views_.make(k, "x");
    feed_.tick(now);
    came += sent(*other, now).size();
  }
  EXPECT_LE(came, static_cast<std::size_t>(ViewConnection::kMostPerSecond) * 11);
  EXPECT_GT(came, 250u);
}

}  // namespace
}  // namespace fiducap::web
