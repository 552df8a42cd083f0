#include "pipeline/correction_ramp.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <string>

#include "base/pose.hpp"
#include "support/jacobian_check.hpp"

namespace fiducap {
namespace {

using Eigen::Vector3d;

constexpr double kRamp_s = 2;
constexpr double kSigma_m = 0.002;
constexpr double kSigma_rad = 0.001;
constexpr double kRounding = 1e-9;  // m and rad; a kilometre has 1e-13 of itself
const Instant kBegin = instant_from_ns(5'000'000'000);

Instant after(double seconds) { return kBegin + from_seconds(seconds); }

BodyEstimate estimate(const Pose& X_WB, double position_sigma_m = kSigma_m,
                      double rotation_sigma_rad = kSigma_rad) {
  BodyEstimate e;
  e.X_WB = X_WB;
  e.covariance.diagonal().head<3>().setConstant(position_sigma_m * position_sigma_m);
  e.covariance.diagonal().segment<3>(3).setConstant(rotation_sigma_rad * rotation_sigma_rad);
  return e;
}

double position_sigma_m(const BodyEstimate& e) {
  return std::sqrt(e.covariance.diagonal().head<3>().maxCoeff());
}
double rotation_sigma_rad(const BodyEstimate& e) {
  return std::sqrt(e.covariance.diagonal().segment<3>(3).maxCoeff());
}

BodyEstimate shown(const CorrectionRamp& ramp, double t_s, BodyEstimate filter) {
  ramp.apply(after(t_s), filter);
  return filter;
}

/// What is published frame by frame, and the largest step between two, in published sigmas.
struct Stream {
  const CorrectionRamp& ramp;
  Vector3d true_step{Vector3d::Zero()};  ///< From frame to frame.
  Eigen::Quaterniond true_turn{Eigen::Quaterniond::Identity()};
  std::optional<Pose> before{};
  double position{};
  double attitude{};

  void frame(double t_s, const BodyEstimate& filter) {
    const BodyEstimate now = shown(ramp, t_s, filter);
    if (before) {
      const Vector3d moved = now.X_WB.p - before->p - true_step;
      position = std::max(position, moved.norm() / position_sigma_m(now));
      const Eigen::Quaterniond turned = now.X_WB.q * (true_turn * before->q).conjugate();
      attitude = std::max(attitude, log_so3(turned).norm() / rotation_sigma_rad(now));
    }
    before = now.X_WB;
  }
  /// Frames until the ramp is over. @return how long that takes
  double run(double period_s, const BodyEstimate& filter) {
    double t_s = 0;
    for (; !ramp.is_over(after(t_s)); t_s += period_s) frame(t_s, filter);
    frame(t_s, filter);
    return t_s;
  }
  void expect_below(double sigmas, const std::string& what = {}) const {
    EXPECT_LT(position, sigmas) << what;
    EXPECT_LT(attitude, sigmas) << what;
  }
};

class Draw {
 public:
  explicit Draw(unsigned seed) : random_(seed) {}
  Vector3d direction() {
    Vector3d d;
    do {
      d = Vector3d::NullaryExpr([&] { return normal_(random_); });
    } while (d.norm() < 1e-3);
    return d.normalized();
  }
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  BodyEstimate body() { return estimate({exp_so3(uniform(0, 3) * direction()), {1, 2, 3}}); }
  /// Published pose of the body before a correction by this number of sigmas.
  Pose before_correction(const BodyEstimate& now, double sigmas) {
    return {(exp_so3(sigmas * kSigma_rad * direction()) * now.X_WB.q).normalized(),
            now.X_WB.p + sigmas * kSigma_m * direction()};
  }

 private:
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

constexpr std::array<double, 6> kRates_hz{30, 50, 100, 240, 500, 1000};

TEST(CorrectionRamp, LeadsFromThePublishedPoseToTheFilters) {
  CorrectionRamp ramp({kRamp_s});
  Draw draw(1);
  const BodyEstimate now = draw.body();
  const Pose published = draw.before_correction(now, 5);
  ramp.correct(published, now, kBegin);
  for (const double s : {-0.05, 0.0}) {
    const Pose first = shown(ramp, s, now).X_WB;
    EXPECT_LT((first.p - published.p).norm(), kRounding);
    EXPECT_LT(angle_between(first.q, published.q), kRounding);
  }
  EXPECT_FALSE(ramp.is_over(after(1.99)));
  EXPECT_TRUE(ramp.is_over(after(kRamp_s)));
  const BodyEstimate last = shown(ramp, kRamp_s, now);
  EXPECT_EQ(last.X_WB.p, now.X_WB.p);
  EXPECT_EQ(last.X_WB.q.coeffs(), now.X_WB.q.coeffs());
  EXPECT_EQ(last.covariance, now.covariance);
}

TEST(CorrectionRamp, TheVelocityIsZeroAtBothEnds) {
  CorrectionRamp ramp({kRamp_s});
  const BodyEstimate now = estimate({});
  ramp.correct({Eigen::Quaterniond::Identity(), {0.01, 0, 0}}, now, kBegin);
  const auto x_at = [&](double s) { return shown(ramp, s, now).X_WB.p.x(); };
  constexpr double kStep_s = 1e-3;
  constexpr double kMean_m_s = 0.01 / kRamp_s;
  EXPECT_LT(std::abs(x_at(kStep_s) - x_at(0)) / kStep_s, 0.01 * kMean_m_s);
  EXPECT_LT(std::abs(x_at(kRamp_s) - x_at(kRamp_s - kStep_s)) / kStep_s, 0.01 * kMean_m_s);
  EXPECT_NEAR(x_at(1), 0.005, kRounding) << "half of it at half the time";
}

TEST(CorrectionRamp, NoFrameMovesByASigma) {
  Draw draw(2);
  for (const double rate_hz : kRates_hz) {
    for (const double sigmas : {0.1, 1.0, 10.0, 40.0, 100.0, 300.0, 1000.0}) {
      CorrectionRamp ramp({kRamp_s});
      const BodyEstimate now = estimate({});
      ramp.correct(draw.before_correction(now, sigmas), now, kBegin);
      Stream stream{ramp};
      const double took_s = stream.run(1 / rate_hz, now);
      stream.expect_below(0.75,
                          std::to_string(sigmas) + " sigmas at " + std::to_string(rate_hz) + " Hz");
      EXPECT_LT(took_s, sigmas <= 40 ? kRamp_s + 2 / rate_hz : 11) << sigmas << " sigmas";
    }
  }
}

TEST(CorrectionRamp, ALowFrameRateMakesTheRampLonger) {
  CorrectionRamp ramp({.seconds = kRamp_s, .frame_s = 0.5});
  Draw draw(3);
  const BodyEstimate now = estimate({});
  ramp.correct(draw.before_correction(now, 10), now, kBegin);
  Stream stream{ramp};
  EXPECT_GT(stream.run(0.5, now), 5);
  stream.expect_below(1);
}

// A correction comes long before the last one is over, in any direction.
TEST(CorrectionRamp, OverlappingCorrectionsDoNotAddUpToAStep) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Draw draw(seed);
    for (const double rate_hz : kRates_hz) {
      CorrectionRamp ramp({kRamp_s});
      BodyEstimate filter = draw.body();
      Stream stream{ramp};
      double next_s = 0;
      double t_s = 0;
      for (; t_s < 8; t_s += 1 / rate_hz) {
        if (t_s >= next_s) {
          const Pose published = shown(ramp, t_s, filter).X_WB;
          // Both the estimate of the image and the one before move.
          filter.X_WB = draw.before_correction(filter, draw.uniform(0, 30));
          ramp.correct(published, filter, after(t_s));
          next_s = t_s + draw.uniform(0.05, 2.5);
        }
        stream.frame(t_s, filter);
      }
      stream.expect_below(1, "seed " + std::to_string(seed) + " at " + std::to_string(rate_hz));
      EXPECT_TRUE(ramp.is_over(after(t_s + 5)));
    }
  }
}

TEST(CorrectionRamp, AShrinkingSigmaMakesTheRampLonger) {
  for (const double rate_hz : kRates_hz) {
    CorrectionRamp ramp({kRamp_s});
    double sigma_m = 0.03;
    const auto filter = [&] { return estimate({}, sigma_m, sigma_m); };
    ramp.correct({exp_so3({0, 0, 0.1}), {0.1, -0.1, 0.1}}, filter(), kBegin);
    Stream stream{ramp};
    double next_image_s = 0.05;
    double t_s = 0;
    for (; !ramp.is_over(after(t_s)); t_s += 1 / rate_hz) {
      if (t_s >= next_image_s) {
        sigma_m = std::max(0.0005, 0.8 * sigma_m);
        ramp.follow(shown(ramp, t_s, filter()).X_WB, filter(), after(t_s));
        next_image_s += 0.05;
      }
      stream.frame(t_s, filter());
    }
    stream.expect_below(1, std::to_string(rate_hz) + " Hz");
    EXPECT_LT(t_s, 10);
  }
}

TEST(CorrectionRamp, ImagesWithoutACorrectionDoNotChangeTheRamp) {
  CorrectionRamp ramp({kRamp_s});
  Draw draw(5);
  const BodyEstimate now = estimate({});
  ramp.correct(draw.before_correction(now, 200), now, kBegin);
  const CorrectionRamp undisturbed = ramp;
  for (double t_s = 0; t_s < 8; t_s += 0.05) {
    const Pose one = shown(ramp, t_s, now).X_WB;
    ASSERT_LT((one.p - shown(undisturbed, t_s, now).X_WB.p).norm(), 1e-6) << t_s;
    ramp.follow(one, now, after(t_s));
  }
}

TEST(CorrectionRamp, AnImageThatCorrectsByAQuarterOfASigmaIsPublishedAtOnce) {
  CorrectionRamp ramp({kRamp_s});
  Draw draw(6);
  const BodyEstimate now = estimate({});
  ramp.follow(draw.before_correction(now, 0.24), now, kBegin);
  EXPECT_TRUE(ramp.is_over(kBegin));
  ramp.follow(draw.before_correction(now, 4), now, kBegin);
  EXPECT_FALSE(ramp.is_over(kBegin));
  EXPECT_TRUE(ramp.is_over(after(0.7))) << "no longer than necessary";
  Stream stream{ramp};
  for (double t_s = 0; t_s < 1; t_s += 1.0 / 30) stream.frame(t_s, now);
  stream.expect_below(0.75);
}

TEST(CorrectionRamp, TheRemainingCorrectionIsInTheCovariance) {
  CorrectionRamp ramp({kRamp_s});
  Draw draw(7);
  for (int i = 0; i < 100; ++i) {
    const BodyEstimate now = draw.body();  // the truth
    ramp.forget();
    ramp.correct(draw.before_correction(now, draw.uniform(1, 40)), now, kBegin);
    const BodyEstimate out = shown(ramp, draw.uniform(0, 1.5), now);
    Vector6d e;
    e << out.X_WB.p - now.X_WB.p, log_so3(out.X_WB.q * now.X_WB.q.conjugate());
    EXPECT_GT(e.head<3>().norm(), 0);
    const Matrix6d P = out.covariance.topLeftCorner<6, 6>();
    EXPECT_LT(squared_distance(e, P), 1);
    EXPECT_GE(std::sqrt(3) * position_sigma_m(out), e.head<3>().norm());
    const Matrix6d added = P - now.covariance.topLeftCorner<6, 6>() - e * e.transpose();
    EXPECT_LT(added.norm(), 1e-12);
  }
}

// A body that drives and turns a kilometre from the origin, about which the map is turned.
TEST(CorrectionRamp, IsSmoothFarFromTheOrigin) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Draw draw(seed);
    CorrectionRamp ramp({kRamp_s});
    const Pose start{draw.body().X_WB.q, 1000 * draw.direction()};
    const Vector3d velocity = 3 * draw.direction();
    const Vector3d rate_W = 2 * draw.direction();
    constexpr double kPeriod_s = 0.01;
    Stream stream{ramp, velocity * kPeriod_s, exp_so3(rate_W * kPeriod_s)};
    // Of the map: the body moves 20 mm aside, nearly all of it by the rotation.
    const Pose X_new_old{exp_so3(2e-5 * draw.direction()), 0.001 * draw.direction()};
    for (int i = 0; i < 400; ++i) {
      const double t_s = i * kPeriod_s;
      const Pose old{exp_so3(rate_W * t_s) * start.q, start.p + velocity * t_s};
      const BodyEstimate filter = estimate(i < 50 ? old : X_new_old * old);
      if (i == 50) ramp.correct(old, filter, after(t_s));
      stream.frame(t_s, filter);
    }
    stream.expect_below(0.5, "seed " + std::to_string(seed));
  }
}

TEST(CorrectionRamp, NonFiniteNumbersEndTheRamp) {
  CorrectionRamp ramp({kRamp_s});
  const double none = std::numeric_limits<double>::quiet_NaN();
  BodyEstimate now = estimate({});
  now.X_WB.p.x() = none;
  ramp.correct({}, now, kBegin);
  EXPECT_TRUE(ramp.is_over(kBegin));
  now = estimate({}, none, none);
  ramp.correct({Eigen::Quaterniond::Identity(), {0.01, 0, 0}}, now, kBegin);
  EXPECT_TRUE(ramp.is_over(after(60)));
}

Pose aside(double metres) { return {Eigen::Quaterniond::Identity(), {0, metres, 0}}; }

/// Of a body 100 m from the origin.
class MapCorrectionsTest : public testing::Test {
 protected:
  std::string add(const std::optional<Pose>& X_new_old, double sigma_m = 0.002, int generation = 0,
                  bool has_pose = true) {
    UpdateReport report;
    report.generation = generation;
    report.map_shift = X_new_old;
    BodyEstimate e = estimate({Eigen::Quaterniond::Identity(), {100, 0, 0}}, sigma_m, sigma_m);
    e.anchored = true;
    return corrections_.add(report, has_pose ? std::optional(e) : std::nullopt);
  }
  MapCorrections corrections_;
};

TEST_F(MapCorrectionsTest, ReportTheMotionOfTheBodyNotOfTheOrigin) {
  EXPECT_EQ(add(Pose{exp_so3({0, 0, 2e-4}), {0, 0, 0}}),
            "a correction of the map has moved it by 20 mm and 0.01 degrees");
  EXPECT_EQ(add(std::nullopt), "");
}

TEST_F(MapCorrectionsTest, ReportTheSumOfSmallCorrections) {
  for (int i = 0; i < 3; ++i) EXPECT_EQ(add(aside(0.003)), "") << i;
  EXPECT_NE(add(aside(0.003)), "");
  EXPECT_EQ(add(aside(0.003)), "") << "the count starts again";
}

TEST_F(MapCorrectionsTest, DoNotReportCorrectionsBackAndForthOrWithinTheSigma) {
  for (int i = 0; i < 100; ++i) EXPECT_EQ(add(aside(i % 2 == 0 ? 0.008 : -0.008)), "");
  EXPECT_EQ(add(aside(0.03), 0.05), "");
}

TEST_F(MapCorrectionsTest, DoNotReportCorrectionsWithoutAPoseOrAtARestart) {
  EXPECT_EQ(add(aside(0.5), 0.002, 0, false), "");
  EXPECT_EQ(add(aside(0.5), 0.002, 1), "");
  EXPECT_NE(add(aside(0.5), 0.002, 1), "");
}

}  // namespace
}  // namespace fiducap
