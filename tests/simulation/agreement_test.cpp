// Cameras and gyroscopes that disagree, in a whole pipeline: the report, its time, and that no pose
// is published afterwards.
#include <gmock/gmock.h>

#include <numbers>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "pipeline/body_pipeline.hpp"
#include "simulation/estimation_data.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

constexpr Instant kMotionStart = instant_from_ns(1'000'000'000);
constexpr double kMotion_s = 25;
// The motion begins after a second at rest.
constexpr double kReportedWithin_s = 12;

/// Errors of the configuration of the sensors.
struct SensorMistake {
  /// True camera axes → configured ones.
  Eigen::Quaterniond camera_turn{Eigen::Quaterniond::Identity()};
  Eigen::Matrix3d imu_axes{Eigen::Matrix3d::Identity()};
  double stamp_error_s{0};
  double stamp_error_from_s{0};
};

struct TurnsOutcome {
  struct Said {
    double at_s{};
    BodyEvent event;
  };
  std::vector<Said> said;  ///< About turns and clocks.
  int poses{0};
  int poses_after{0};  ///< … published after the first report.
  bool is_established{false};
  std::optional<ClockJump> jump;
};

bool is_about_turns(BodyEvent::Kind kind) {
  return kind == BodyEvent::Kind::kTurnsDisagree || kind == BodyEvent::Kind::kTurnsAgree ||
         kind == BodyEvent::Kind::kClockJumped;
}

class MistakenBody {
 public:
  MistakenBody(const std::string& world, std::uint64_t seed, SensorMistake mistake)
      : mistake_(std::move(mistake)) {
    room_.preset = world;
    body_.cameras = {forward_mount()};
    body_.camera.images = false;
    body_.trajectory.kind = world;
    body_.trajectory.seed = body_.seed = seed;
  }

  TurnsOutcome run() {
    BodyPipeline pipeline(setup());
    const auto source =
        value_of(simulation::make_simulated_source(room_, body_, kMotionStart, nullptr));
    TurnsOutcome out;
    while (auto sample = value_of(source->next({}))) {
      const double t_s = to_seconds(time_of(*sample) - kMotionStart);
      if (t_s > kMotion_s) break;
      (void)pipeline.push(mistaken(std::move(*sample), t_s));
      while (pipeline.next() != nullptr)
        if (const BodyUpdate* update = pipeline.take(view_)) note(*update, t_s, out);
    }
    out.is_established = pipeline.agreement().is_established();
    out.jump = pipeline.agreement().clock_jump();
    return out;
  }

 private:
  [[nodiscard]] PipelineSetup setup() const {
    PipelineSetup setup;
    setup.sensors.cameras = body_.cameras;
    setup.sensors.cameras[0].X_BV.q = setup.sensors.cameras[0].X_BV.q * mistake_.camera_turn;
    setup.sensors.imu = body_.imu.noise;
    for (const RecordedTag& tag : simulation::tags_of(room_))
      setup.tags.sizes_m[tag.tag_id] = tag.edge_m;
    return setup;
  }
  [[nodiscard]] SensorSample mistaken(SensorSample sample, double t_s) const {
    if (auto* imu = std::get_if<ImuSample>(&sample)) {
      imu->w_WB_B = mistake_.imu_axes * imu->w_WB_B;
    } else if (t_s >= mistake_.stamp_error_from_s) {
      std::get<CornerFrame>(sample).exposed_at += from_seconds(mistake_.stamp_error_s);
    }
    return sample;
  }
  static void note(const BodyUpdate& update, double t_s, TurnsOutcome& out) {
    for (const BodyEvent& event : update.events)
      if (is_about_turns(event.kind)) out.said.push_back({t_s, event});
    if (!update.is_placed()) return;
    ++out.poses;
    out.poses_after += out.said.empty() ? 0 : 1;
  }

  SensorMistake mistake_;
  simulation::RoomConfig room_;
  simulation::SimulatedBodyConfig body_;
  MapView view_{std::make_shared<const TagMap>()};
};

TurnsOutcome run_with(const SensorMistake& mistake, const std::string& world = "table") {
  return MistakenBody(world, 2, mistake).run();
}

TEST(AgreementSimulation, ReportsNothingOfACorrectBody) {
  for (const char* world : {"table", "sparse", "loop"}) {
    const TurnsOutcome clean = run_with({}, world);
    EXPECT_TRUE(clean.said.empty()) << world << ": " << clean.said.front().event.text;
    EXPECT_GT(clean.poses, 200) << world;
  }
  EXPECT_TRUE(run_with({}).is_established);
}

TEST(AgreementSimulation, RefusesAWronglyTurnedCamera) {
  for (const char* world : {"table", "sparse"}) {
    const TurnsOutcome turned = run_with({.camera_turn = exp_so3({0, 0, pi / 2})}, world);
    ASSERT_FALSE(turned.said.empty());
    EXPECT_LT(turned.said.front().at_s, kReportedWithin_s);
    EXPECT_EQ(turned.said.back().event.kind, BodyEvent::Kind::kTurnsDisagree);
    EXPECT_THAT(turned.said.back().event.text, HasSubstr("about its optical axis"));
    EXPECT_EQ(turned.poses_after, 0);
  }
}

TEST(AgreementSimulation, RefusesAGyroWithSwappedAxes) {
  SensorMistake swapped;
  swapped.imu_axes << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  const TurnsOutcome outcome = run_with(swapped);
  ASSERT_FALSE(outcome.said.empty());
  EXPECT_LT(outcome.said.front().at_s, kReportedWithin_s);
  EXPECT_THAT(outcome.said.back().event.text, HasSubstr("(y, x, z)"));
  EXPECT_EQ(outcome.poses_after, 0);
}

TEST(AgreementSimulation, ReportsHowFarDroppedStampsAreOff) {
  for (const double error_s : {0.5, -0.5}) {
    const TurnsOutcome late = run_with({.stamp_error_s = error_s});
    ASSERT_FALSE(late.said.empty()) << error_s;
    const auto& by_turns = late.said.back();
    EXPECT_LT(by_turns.at_s, kReportedWithin_s);
    EXPECT_THAT(by_turns.event.text, HasSubstr(error_s > 0 ? " s late" : " s early"));
    EXPECT_THAT(by_turns.event.text, testing::ContainsRegex("stamped 0\\.(49|50|51|52) s"));
    // Before any rotation, late images are reported.
    if (error_s < 0) {
      EXPECT_THAT(late.said.front().event.text, HasSubstr("too late to be used"));
    }
    EXPECT_EQ(late.poses_after, 0);
  }
}

TEST(AgreementSimulation, OffersTheJumpOfAClock) {
  const TurnsOutcome jumped = run_with({.stamp_error_s = 0.2, .stamp_error_from_s = 12});
  ASSERT_FALSE(jumped.said.empty());
  EXPECT_EQ(jumped.said.front().event.kind, BodyEvent::Kind::kClockJumped);
  EXPECT_GT(jumped.said.front().at_s, 12);
  ASSERT_TRUE(jumped.jump);
  EXPECT_NEAR(to_seconds(jumped.jump->change), -0.2, 0.03);
}

}  // namespace
}  // namespace fiducap
