#include <gtest/gtest.h>

#include "robot.hpp"
#include "support/allocation_counter.hpp"
#include "support/fake_clock.hpp"

namespace fiducap::simulation {
namespace {

constexpr Instant kStart = instant_from_ns(1'000'000'000);

SimulatedBodyConfig robot_with_images(double duration_s) {
  SimulatedBodyConfig body = corner_robot("survey");
  body.cameras[0].model = {188, 120, 115, 115, 93.5, 59.5};
  body.cameras.push_back(body.cameras[0]);
  body.camera.images = true;
  body.trajectory.duration_s = duration_s;
  return body;
}

TEST(SimulatedImages, AreTheSameWhetherDrawnAheadInSlicesOrAtOnce) {
  SimulatedBodyConfig body = robot_with_images(3);
  body.faults.drop_image = 0.2;
  body.faults.jitter_s = 0.01;
  body.faults.occlude = 0.2;
  const FakeClock clock(kStart);
  const auto paced = make_simulated_source(room_of("hall"), body, kStart, &clock).value();
  const auto unpaced = make_simulated_source(room_of("hall"), body, kStart, nullptr).value();
  const auto a = run_out(*paced);
  const auto b = run_out(*unpaced);
  ASSERT_EQ(a.size(), b.size());
  int images = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(time_of(a[i]), time_of(b[i]));
    ASSERT_EQ(a[i].index(), b[i].index());
    if (!std::holds_alternative<CameraFrame>(a[i])) continue;
    ++images;
    ASSERT_EQ(std::get<CameraFrame>(a[i]).camera, std::get<CameraFrame>(b[i]).camera);
    ASSERT_EQ(std::get<CameraFrame>(a[i]).image->pixels, std::get<CameraFrame>(b[i]).image->pixels);
  }
  EXPECT_GT(images, 80);
}

TEST(SimulatedImages, SwitchingThemOffDoesNotChangeTheImu) {
  SimulatedBodyConfig body = robot_with_images(1);
  const auto with = only<ImuSample>(
      run_out(*make_simulated_source(room_of("hall"), body, kStart, nullptr).value()));
  body.camera.images = false;
  const auto without = only<ImuSample>(
      run_out(*make_simulated_source(room_of("hall"), body, kStart, nullptr).value()));
  ASSERT_EQ(with.size(), without.size());
  for (std::size_t k = 0; k < with.size(); ++k) {
    EXPECT_EQ(with[k].f_B, without[k].f_B);
    EXPECT_EQ(with[k].w_WB_B, without[k].w_WB_B);
  }
}

TEST(SimulatedImages, ASteadyStreamAllocatesNothing) {
  const FakeClock clock(kStart);
  const auto source =
      make_simulated_source(room_of("hall"), robot_with_images(0), kStart, &clock).value();
  const auto run_until = [&](double t_s) {
    int images = 0;
    for (;;) {
      const auto sample = source->next({});
      images += std::holds_alternative<CameraFrame>(**sample) ? 1 : 0;
      if (to_seconds(time_of(**sample) - kStart) > t_s) return images;
    }
  };
  (void)run_until(100);  // once around the hall: every tag was printed
  const AllocationCounter counter;
  EXPECT_GT(run_until(130), 1000);
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace fiducap::simulation
