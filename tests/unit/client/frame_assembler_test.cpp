#include "src/frame_assembler.hpp"

#include <gtest/gtest.h>

#include "support/allocation_counter.hpp"

namespace fiducap::sdk {
namespace {

constexpr std::uint64_t kSession = 9;
constexpr std::uint32_t kBodies = 5;  // two parts: 3 + 2

class FrameAssemblerTest : public testing::Test {
 protected:
  FrameAssemblerTest() {
    assembler_.begin(kSession);
    add_model(1);
  }
  static PartPlace place(std::uint32_t index) { return {index, 2, index * 3, kBodies}; }
  void add_model_part(std::uint64_t generation, std::uint32_t index) {
    ModelPart part{kSession, generation, 0, place(index), {}};
    for (std::uint32_t i = index * 3; i < (index == 0 ? 3 : kBodies); ++i) {
      part.bodies.emplace_back(static_cast<int>(i) + 1,
                               "body" + std::to_string(i) + "g" + std::to_string(generation));
    }
    assembler_.add(part);
  }
  void add_model(std::uint64_t generation) {
    add_model_part(generation, 0);
    add_model_part(generation, 1);
  }
  static FramePart part(std::uint64_t number, std::uint32_t index, std::uint64_t generation = 1) {
    FramePart made;
    made.session = kSession;
    made.model_generation = generation;
    made.place = place(index);
    made.frame.number = number;
    for (std::uint32_t i = index * 3; i < (index == 0 ? 3 : kBodies); ++i) {
      Body body;
      body.id = static_cast<int>(i) + 1;
      body.position_m[0] = static_cast<double>(number);
      made.frame.bodies.push_back(body);
    }
    return made;
  }
  Frame* add(std::uint64_t number, std::uint32_t index, std::uint64_t generation = 1) {
    return assembler_.add(part(number, index, generation));
  }

  FrameAssembler assembler_;
};

TEST_F(FrameAssemblerTest, JoinsPartsInOrder) {
  EXPECT_EQ(add(1, 0), nullptr);
  const Frame* frame = add(1, 1);
  ASSERT_NE(frame, nullptr);
  ASSERT_EQ(frame->bodies.size(), kBodies);
  EXPECT_EQ(frame->bodies[0].name, "body0g1");
  EXPECT_EQ(frame->bodies[4].name, "body4g1");
}

TEST_F(FrameAssemblerTest, JoinsPartsThatOvertakeEachOther) {
  EXPECT_EQ(add(1, 1), nullptr);
  EXPECT_EQ(add(2, 0), nullptr);
  ASSERT_NE(add(1, 0), nullptr);
  const Frame* frame = add(2, 1);
  ASSERT_NE(frame, nullptr);
  for (const Body& body : frame->bodies) EXPECT_EQ(body.position_m[0], 2.0);
  EXPECT_EQ(assembler_.lost(), 0u);
}

TEST_F(FrameAssemblerTest, IgnoresAPartThatCameTwice) {
  EXPECT_EQ(add(1, 0), nullptr);
  EXPECT_EQ(add(1, 0), nullptr);
  EXPECT_NE(add(1, 1), nullptr);
  EXPECT_EQ(add(1, 1), nullptr) << "the frame is done";
}

TEST_F(FrameAssemblerTest, CountsFramesWithAMissingPart) {
  add(1, 0);
  add(1, 1);
  for (std::uint64_t number = 2; number <= 10; ++number) EXPECT_EQ(add(number, 0), nullptr);
  add(11, 0);
  EXPECT_NE(add(11, 1), nullptr);
  EXPECT_EQ(assembler_.lost(), 9u);
  EXPECT_EQ(assembler_.received(), 2u);
}

TEST_F(FrameAssemblerTest, DropsWhatIsOlderThanAFinishedFrame) {
  add(2, 0);
  EXPECT_NE(add(2, 1), nullptr);
  EXPECT_EQ(add(1, 0), nullptr);
  EXPECT_EQ(add(1, 1), nullptr);
}

TEST_F(FrameAssemblerTest, IgnoresAnotherSession) {
  FramePart other = part(1, 0);
  other.session = kSession + 1;
  EXPECT_EQ(assembler_.add(other), nullptr);
  EXPECT_EQ(add(1, 1), nullptr);
  EXPECT_NE(add(1, 0), nullptr);
}

TEST_F(FrameAssemblerTest, IgnoresFramesWhoseNamesItDoesNotKnow) {
  add(1, 0, 2);
  EXPECT_EQ(add(1, 1, 2), nullptr);
  add_model_part(2, 0);
  add(2, 0, 2);
  EXPECT_EQ(add(2, 1, 2), nullptr) << "half a model is none";
  add_model_part(2, 1);
  EXPECT_EQ(assembler_.model_generation(), 2u);
  add(3, 0, 2);
  const Frame* frame = add(3, 1, 2);
  ASSERT_NE(frame, nullptr);
  EXPECT_EQ(frame->bodies[3].name, "body3g2");
}

TEST_F(FrameAssemblerTest, RefusesBodiesThatAreNotThoseOfTheModel) {
  FramePart wrong = part(1, 0);
  wrong.frame.bodies[1].id = 77;
  EXPECT_EQ(assembler_.add(wrong), nullptr);
  EXPECT_EQ(add(1, 1), nullptr);
}

TEST_F(FrameAssemblerTest, NeverShowsAnOldPoseInAPlaceThatNoPartFilled) {
  add(1, 0);
  ASSERT_NE(add(1, 1), nullptr);
  for (std::uint64_t number = 2; number < 5; ++number) {
    FramePart twice =
        part(number, 0);  // claims to be the second part, fills the first places again
    twice.place = {1, 2, 0, kBodies};
    twice.frame.bodies.resize(2);
    add(number, 0);
    EXPECT_EQ(assembler_.add(twice), nullptr);
  }
}

TEST_F(FrameAssemblerTest, StartsAgainWithANewSession) {
  add(100, 0);
  EXPECT_NE(add(100, 1), nullptr);
  assembler_.begin(kSession);
  EXPECT_EQ(assembler_.model_generation(), 0u);
  add_model(1);
  add(1, 0);
  EXPECT_NE(add(1, 1), nullptr);
  EXPECT_EQ(assembler_.lost(), 0u);
}

TEST_F(FrameAssemblerTest, AnEmptySceneIsAFrame) {
  assembler_.begin(kSession);
  assembler_.add(ModelPart{kSession, 1, 0, {0, 1, 0, 0}, {}});
  FramePart empty;
  empty.session = kSession;
  empty.model_generation = 1;
  empty.place = {0, 1, 0, 0};
  empty.frame.number = 1;
  EXPECT_NE(assembler_.add(empty), nullptr);
}

TEST_F(FrameAssemblerTest, AllocatesNothingAfterWarmUp) {
  FramePart first = part(0, 0);
  FramePart second = part(0, 1);
  const auto run = [&](std::uint64_t from, std::uint64_t to) {
    for (std::uint64_t number = from; number < to; ++number) {
      first.frame.number = second.frame.number = number;
      EXPECT_EQ(assembler_.add(first), nullptr);
      EXPECT_NE(assembler_.add(second), nullptr);
    }
  };
  run(1, 10);
  const AllocationCounter allocations;
  run(10, 100);
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace fiducap::sdk
