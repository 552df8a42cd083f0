#include "pipeline/correction_ramp.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <random>

#include "base/pose.hpp"

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

/// What is published frame by frame, and the largest step between two, in published sigmas.
struct Stream {
  const CorrectionRamp& ramp;
  Vector3d true_step{Vector3d::Zero()};  ///< From frame to frame.
  Eigen::Quaterniond true_turn{Eigen::Quaterniond::Identity()};
  std::optional<Pose> before{};
  double position{};
  double attitude{};

  void frame(Instant at, const BodyEstimate& filter) {
    BodyEstimate shown = filter;
    ramp.apply(at, shown);
    if (before) {
      const Vector3d moved = shown.X_WB.p - before->p - true_step;
      position = std::max(position, moved.norm() / position_sigma_m(shown));
      const Eigen::Quaterniond turned = shown.X_WB.q * (true_turn * before->q).conjugate();
      attitude = std::max(attitude, log_so3(turned).norm() / rotation_sigma_rad(shown));
    }
    before = shown.X_WB;
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
  Eigen::Quaterniond attitude() { return exp_so3(uniform(0, 3) * direction()); }

 private:
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

/// Published pose of the body before a correction by this number of sigmas.
Pose before_correction(const Pose& now, double sigmas, Draw& draw) {
  return {(exp_so3(sigmas * kSigma_rad * draw.direction()) * now.q).normalized(),
          now.p + sigmas * kSigma_m * draw.direction()};
}

constexpr std::array<double, 6> kRates_hz{30, 50, 100, 240, 500, 1000};

TEST(CorrectionRamp, PublishesThePoseOfBeforeAtFirstAndTheFiltersInTheEnd) {
  CorrectionRamp ramp({kRamp_s});
  Draw draw(1);
  const BodyEstimate now = estimate({draw.attitude(), {1, 2, 3}});
  const Pose shown = before_correction(now.X_WB, 5, draw);
  ramp.correct(shown, now, kBegin);
  for (const double s : {-0.05, 0.0}) {
    BodyEstimate first = now;
    ramp.apply(after(s), first);
    EXPECT_LT((first.X_WB.p - shown.p).norm(), kRounding);
    EXPECT_LT(angle_between(first.X_WB.q, shown.q), kRounding);
  }
  EXPECT_FALSE(ramp.is_over(after(1.99)));
  EXPECT_TRUE(ramp.is_over(after(kRamp_s)));
  BodyEstimate last = now;
  ramp.apply(after(kRamp_s), last);
  EXPECT_EQ(last.X_WB.p, now.X_WB.p);
  EXPECT_EQ(last.X_WB.q.coeffs(), now.X_WB.q.coeffs());
  EXPECT_EQ(last.covariance, now.covariance);
}

TEST(CorrectionRamp, BeginsAndEndsWithoutAKinkInTheVelocity) {
  CorrectionRamp ramp({kRamp_s});
  const BodyEstimate now = estimate({});
  ramp.correct({Eigen::Quaterniond::Identity(), {0.01, 0, 0}}, now, kBegin);
  const auto x_at = [&](double s) {
    BodyEstimate shown = now;
    ramp.apply(after(s), shown);
    return shown.X_WB.p.x();
  };
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
      ramp.correct(before_correction(now.X_WB, sigmas, draw), now, kBegin);
      Stream stream{ramp};
      double t_s = 0;
      for (; !ramp.is_over(after(t_s)); t_s += 1 / rate_hz) stream.frame(after(t_s), now);
      stream.frame(after(t_s), now);
      EXPECT_LT(stream.position, 0.75) << sigmas << " sigmas at " << rate_hz << " Hz";
      EXPECT_LT(stream.attitude, 0.75) << sigmas << " sigmas at " << rate_hz << " Hz";
      EXPECT_LT(t_s, sigmas <= 40 ? kRamp_s + 2 / rate_hz : 11) << sigmas << " sigmas";
    }
  }
}

TEST(CorrectionRamp, ASlowServerGetsLongerRamps) {
  CorrectionRamp ramp({.seconds = kRamp_s, .frame_s = 0.5});
  Draw draw(3);
  const BodyEstimate now = estimate({});
  ramp.correct(before_correction(now.X_WB, 10, draw), now, kBegin);
  Stream stream{ramp};
  double t_s = 0;
  for (; !ramp.is_over(after(t_s)); t_s += 0.5) stream.frame(after(t_s), now);
  stream.frame(after(t_s), now);
  EXPECT_LT(stream.position, 1);
  EXPECT_LT(stream.attitude, 1);
  EXPECT_GT(t_s, 5);
}

// Corrections come long before the last one is over, in any direction, also back.
TEST(CorrectionRamp, CorrectionsThatOverlapDoNotAddUpToAStep) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Draw draw(seed);
    for (const double rate_hz : kRates_hz) {
      CorrectionRamp ramp({kRamp_s});
      BodyEstimate filter = estimate({draw.attitude(), {1, 2, 3}});
      Stream stream{ramp};
      double next_s = 0;
      double t_s = 0;
      for (; t_s < 8; t_s += 1 / rate_hz) {
        if (t_s >= next_s) {
          BodyEstimate shown = filter;
          ramp.apply(after(t_s), shown);
          // Both the estimate of the image and the one before move.
          filter.X_WB = before_correction(filter.X_WB, draw.uniform(0, 30), draw);
          ramp.correct(shown.X_WB, filter, after(t_s));
          next_s = t_s + draw.uniform(0.05, 2.5);
        }
        stream.frame(after(t_s), filter);
      }
      EXPECT_LT(stream.position, 1) << "seed " << seed << " at " << rate_hz << " Hz";
      EXPECT_LT(stream.attitude, 1) << "seed " << seed << " at " << rate_hz << " Hz";
      EXPECT_TRUE(ramp.is_over(after(t_s + 5)));
    }
  }
}

TEST(CorrectionRamp, ASigmaThatShrinksMakesWhatIsLeftTakeLonger) {
  for (const double rate_hz : kRates_hz) {
    CorrectionRamp ramp({kRamp_s});
    Draw draw(4);
    double sigma_m = 0.03;
    const auto filter = [&] { return estimate({}, sigma_m, sigma_m); };
    const Pose shown{exp_so3({0, 0, 0.1}), {0.1, -0.1, 0.1}};
    ramp.correct(shown, filter(), kBegin);
    Stream stream{ramp};
    double next_image_s = 0.05;
    double t_s = 0;
    for (; !ramp.is_over(after(t_s)); t_s += 1 / rate_hz) {
      if (t_s >= next_image_s) {
        sigma_m = std::max(0.0005, 0.8 * sigma_m);
        BodyEstimate published = filter();
        ramp.apply(after(t_s), published);
        ramp.follow(published.X_WB, filter(), after(t_s));
        next_image_s += 0.05;
      }
      stream.frame(after(t_s), filter());
    }
    EXPECT_LT(stream.position, 1) << rate_hz << " Hz";
    EXPECT_LT(stream.attitude, 1) << rate_hz << " Hz";
    EXPECT_LT(t_s, 10);
  }
}

TEST(CorrectionRamp, ImagesThatChangeNothingLeaveTheCurveAsItIs) {
  CorrectionRamp ramp({kRamp_s});
  CorrectionRamp undisturbed({kRamp_s});
  Draw draw(5);
  const BodyEstimate now = estimate({});
  const Pose shown = before_correction(now.X_WB, 200, draw);
  ramp.correct(shown, now, kBegin);
  undisturbed.correct(shown, now, kBegin);
  for (double t_s = 0; t_s < 8; t_s += 0.05) {
    BodyEstimate one = now;
    BodyEstimate other = now;
    ramp.apply(after(t_s), one);
    undisturbed.apply(after(t_s), other);
    ASSERT_LT((one.X_WB.p - other.X_WB.p).norm(), 1e-6) << t_s;
    ramp.follow(one.X_WB, now, after(t_s));
  }
}

TEST(CorrectionRamp, WhatAnImageCorrectsByLessThanAQuarterOfASigmaIsPublishedAtOnce) {
  CorrectionRamp ramp({kRamp_s});
  Draw draw(6);
  const BodyEstimate now = estimate({});
  ramp.follow(before_correction(now.X_WB, 0.24, draw), now, kBegin);
  EXPECT_TRUE(ramp.is_over(kBegin));
  ramp.follow(before_correction(now.X_WB, 4, draw), now, kBegin);
  EXPECT_FALSE(ramp.is_over(kBegin));
  EXPECT_TRUE(ramp.is_over(after(0.7))) << "no longer than it has to be";
  Stream stream{ramp};
  for (double t_s = 0; t_s < 1; t_s += 1.0 / 30) stream.frame(after(t_s), now);
  EXPECT_LT(stream.position, 0.75);
  EXPECT_LT(stream.attitude, 0.75);
}

TEST(CorrectionRamp, WhatIsLeftIsInTheCovariance) {
  CorrectionRamp ramp({kRamp_s});
  Draw draw(7);
  for (int i = 0; i < 100; ++i) {
    const BodyEstimate now = estimate({draw.attitude(), {1, 2, 3}});
    ramp.forget();
    ramp.correct(before_correction(now.X_WB, draw.uniform(1, 40), draw), now, kBegin);
    BodyEstimate shown = now;
    ramp.apply(after(draw.uniform(0, 1.5)), shown);
    // The filter's pose is the truth here.
    Eigen::Matrix<double, 6, 1> e;
    e << shown.X_WB.p - now.X_WB.p, log_so3(shown.X_WB.q * now.X_WB.q.conjugate());
    EXPECT_GT(e.head<3>().norm(), 0);
    const Eigen::Matrix<double, 6, 6> P = shown.covariance.topLeftCorner<6, 6>();
    EXPECT_LT(e.dot(P.ldlt().solve(e)), 1);
    EXPECT_GE(std::sqrt(3) * position_sigma_m(shown), e.head<3>().norm());
    const Eigen::Matrix<double, 6, 6> added =
        P - now.covariance.topLeftCorner<6, 6>() - e * e.transpose();
    EXPECT_LT(added.norm(), 1e-12);
  }
}

// A body that drives and turns a kilometre from the origin, about which the map is turned.
TEST(CorrectionRamp, AFarOriginDoesNoHarm) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Draw draw(seed);
    CorrectionRamp ramp({kRamp_s});
    const Pose start{draw.attitude(), 1000 * draw.direction()};
    const Vector3d velocity = 3 * draw.direction();
    const Vector3d rate_W = 2 * draw.direction();
    const double rate_hz = 100;
    Stream stream{ramp, velocity / rate_hz, exp_so3(rate_W / rate_hz)};
    // Of the map: the body goes 20 mm aside, nearly all of it by the turn.
    const Pose X_new_old{exp_so3(2e-5 * draw.direction()), 0.001 * draw.direction()};
    for (int i = 0; i < 400; ++i) {
      const double t_s = i / rate_hz;
      const Pose old{exp_so3(rate_W * t_s) * start.q, start.p + velocity * t_s};
      const BodyEstimate filter = estimate(i < 50 ? old : X_new_old * old);
      if (i == 50) ramp.correct(old, filter, after(t_s));
      stream.frame(after(t_s), filter);
    }
    EXPECT_LT(stream.position, 0.5) << "seed " << seed;
    EXPECT_LT(stream.attitude, 0.5) << "seed " << seed;
  }
}

TEST(CorrectionRamp, WhatIsNoNumberIsForgotten) {
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

}  // namespace
}  // namespace fiducap
