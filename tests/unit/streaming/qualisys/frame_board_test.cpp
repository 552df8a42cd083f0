#include "streaming/qualisys/frame_board.hpp"

#include <gtest/gtest.h>

#include "support/allocation_counter.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::qualisys {
namespace {

class QualisysFrameBoard : public testing::Test {
 protected:
  void put(std::uint64_t number) {
    const auto frame = make_scene_frame({"a"}, number);
    bodies_.update(*frame->model);
    board_.put(frame, bodies_);
  }
  BodyTable bodies_;
  FrameBoard board_{QualisysConfig{}};
  Profile profile_{Components::all(), std::endian::little, false};
};

TEST_F(QualisysFrameBoard, KnowsNoFrameAtFirst) { EXPECT_EQ(board_.number(), 0u); }

TEST_F(QualisysFrameBoard, EncodesOncePerProfile) {
  put(1);
  const auto first = board_.encoded(profile_);
  EXPECT_EQ(board_.encoded(profile_), first);
  Profile other = profile_;
  other.order = std::endian::big;
  EXPECT_NE(board_.encoded(other), first);
  EXPECT_EQ(board_.encoded(profile_), first);
}

TEST_F(QualisysFrameBoard, ANewFrameIsEncodedAnew) {
  put(1);
  const auto first = board_.encoded(profile_);
  put(2);
  EXPECT_NE(board_.encoded(profile_)->packet, first->packet);
}

TEST_F(QualisysFrameBoard, AllocatesNothingAfterWarmUp) {
  const auto frame = make_scene_frame({"a", "b"});
  bodies_.update(*frame->model);
  Profile other = profile_;
  other.wide = true;
  std::shared_ptr<const EncodedFrame> waiting;  // a slow client still holds the last one
  const auto round = [&] {
    board_.put(frame, bodies_);
    waiting = board_.encoded(profile_);
    (void)board_.encoded(other);
  };
  for (int i = 0; i < 10; ++i) round();
  const AllocationCounter counter;
  for (int i = 0; i < 100; ++i) round();
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace fiducap::qualisys
