#include "streaming/conventions/pose_jumps.hpp"

#include <gtest/gtest.h>

#include <chrono>

#include "base/so3.hpp"
#include "support/allocation_counter.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

class PoseJumpsTest : public testing::Test {
 protected:
  void step() {
    frame_->at += 10ms;
    BodyPose& body = frame_->bodies[0];
    body.X_WP.p += 0.01 * body.v_WP;
    body.X_WP.q = (body.X_WP.q * exp_so3(0.01 * body.w_WP_P)).normalized();
    jumps_.observe(*frame_);
  }
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"drone", "rover"});
  PoseJumps jumps_;
};

TEST_F(PoseJumpsTest, FastMotionIsNoJump) {
  frame_->bodies[0].v_WP = {20, 0, 0};
  frame_->bodies[0].w_WP_P = {0, 0, 15};
  for (int i = 0; i < 100; ++i) step();
  EXPECT_EQ(jumps_.count(0), 0u);
}

TEST_F(PoseJumpsTest, AStepOfTheMapIsOne) {
  step();
  frame_->bodies[0].X_WP.p.y() += 0.3;
  step();
  step();
  EXPECT_EQ(jumps_.count(0), 1u);
  EXPECT_EQ(jumps_.count(1), 0u) << "the other body did not move";
}

TEST_F(PoseJumpsTest, ATurnOfTheMapIsOne) {
  step();
  frame_->bodies[0].X_WP.q = exp_so3({0, 0, 0.4}) * frame_->bodies[0].X_WP.q;
  step();
  EXPECT_EQ(jumps_.count(0), 1u);
}

TEST_F(PoseJumpsTest, TheReturnOfALostBodyIsOneTheFirstAppearanceIsNone) {
  frame_->bodies[0].valid = false;
  step();
  frame_->bodies[0].valid = true;
  step();
  EXPECT_EQ(jumps_.count(0), 0u);
  frame_->bodies[0].valid = false;
  step();
  frame_->bodies[0].valid = true;
  step();
  EXPECT_EQ(jumps_.count(0), 1u);
}

TEST_F(PoseJumpsTest, AnotherBodyInTheSamePlaceStartsAnew) {
  step();
  frame_->bodies[0].body_id = 17;
  frame_->bodies[0].X_WP.p.x() += 5;
  step();
  EXPECT_EQ(jumps_.count(0), 0u);
}

TEST_F(PoseJumpsTest, AllocatesNothingWhileTheBodiesAreTheSame) {
  step();
  const AllocationCounter counter;
  for (int i = 0; i < 100; ++i) step();
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace fiducap
