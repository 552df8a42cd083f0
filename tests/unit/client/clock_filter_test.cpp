#include "src/clock_filter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace fiducap::sdk {
namespace {

// The requirement: 95 % of all estimates within this of the truth, with delays of 5 ms ± 2 ms.
constexpr double kRequired_s = 300e-6;
constexpr double kDriftFollowed = 50e-6;

/// Two clocks and the network between them. Truth is known.
class ClockFilterTest : public testing::Test {
 protected:
  using Delay = std::function<double(std::mt19937&)>;

  static Delay uniform(double mean_s, double spread_s) {
    return [=](std::mt19937& random) {
      return std::uniform_real_distribution<double>(mean_s - spread_s, mean_s + spread_s)(random);
    };
  }
  static Delay exponential(double least_s, double mean_s) {
    return [=](std::mt19937& random) {
      return least_s + std::exponential_distribution<double>(1 / mean_s)(random);
    };
  }

  Nanoseconds server_of(Nanoseconds own) const {
    return own + offset_ +
           static_cast<Nanoseconds>(std::llround(static_cast<double>(own - kStart) * drift_));
  }
  double error_s(Nanoseconds own) const {
    return static_cast<double>(filter_.at(own).offset - (server_of(own) - own)) * 1e-9;
  }
  void query(const Delay& there, const Delay& back) {
    const auto span = [&](const Delay& delay) {
      return static_cast<Nanoseconds>(delay(random_) * 1e9);
    };
    const Nanoseconds came = now_ + span(there);
    const Nanoseconds went = came + 20'000;  // the server takes 20 µs
    filter_.add({now_, server_of(came), server_of(went), went + span(back)});
    now_ += 100 * kMillisecond;
  }
  void query(int times, const Delay& there, const Delay& back) {
    for (int i = 0; i < times; ++i) query(there, back);
  }
  void query(int times) { query(times, usual_, usual_); }
  void restart(unsigned seed) {
    random_.seed(seed);
    filter_.reset();
  }
  static double p95(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() * 95 / 100];
  }
  /// 95th percentile of absolute errors just before each further reply.
  double p95_error_s(int samples) {
    std::vector<double> errors;
    for (int i = 0; i < samples; ++i) {
      errors.push_back(std::abs(error_s(now_)));
      query(1);
    }
    return p95(errors);
  }

  static constexpr Nanoseconds kStart = 1000 * kSecond;
  const Delay usual_ = uniform(5e-3, 2e-3);
  Nanoseconds now_ = kStart;
  Nanoseconds offset_ = -86'400 * kSecond + 123'456'789;
  double drift_ = 0;
  std::mt19937 random_{1};  // NOLINT: the same numbers in every run
  ClockFilter filter_;
};

TEST_F(ClockFilterTest, IsUnknownBeforeFourSamples) {
  const auto delay = uniform(1e-3, 0.1e-3);
  for (int i = 0; i < 3; ++i) {
    query(delay, delay);
    EXPECT_FALSE(filter_.at(now_).known);
  }
  query(delay, delay);
  EXPECT_TRUE(filter_.at(now_).known);
  EXPECT_EQ(filter_.at(now_).samples, 4);
}

TEST_F(ClockFilterTest, IsExactWithoutJitter) {
  query(50, uniform(5e-3, 0), uniform(5e-3, 0));
  constexpr double kRounding_s = 10e-9;
  EXPECT_NEAR(error_s(now_), 0, kRounding_s);
  EXPECT_NEAR(filter_.at(now_).round_trip_s, 10e-3, 1e-6);
}

TEST_F(ClockFilterTest, ErrorIsWithin300MicrosecondsAtTheUsualJitter) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    restart(seed);
    query(50);  // five seconds to converge
    EXPECT_LT(p95_error_s(600), kRequired_s) << "seed " << seed;
  }
}

TEST_F(ClockFilterTest, EstimatesDriftOf50ppm) {
  for (const double drift : {kDriftFollowed, -kDriftFollowed}) {
    for (unsigned seed = 1; seed <= 10; ++seed) {
      restart(seed);
      drift_ = drift;
      query(50);
      EXPECT_LT(p95_error_s(1200), kRequired_s) << "seed " << seed;
      constexpr double kDriftError = 10e-6;  // 2 min of this jitter
      EXPECT_NEAR(filter_.at(now_).drift, drift, kDriftError) << "seed " << seed;
    }
  }
}

TEST_F(ClockFilterTest, FollowsDriftThatChangesWithTemperature) {
  std::vector<double> errors;
  for (int i = 0; i < 3000; ++i) {
    const double drift = kDriftFollowed * std::sin(2 * M_PI * i / 3000);  // 5 min period
    offset_ += static_cast<Nanoseconds>(drift * 1e8);
    if (i > 100) errors.push_back(std::abs(error_s(now_)));
    query(1);
  }
  EXPECT_LT(p95(errors), kRequired_s);
}

TEST_F(ClockFilterTest, SigmaIsConsistentWithTheErrors) {
  // Share of errors below two sigmas over many runs; a Gaussian would give 95 %. Much less is too
  // small a sigma, all would be one without meaning.
  const auto busy = [this, slow = exponential(5e-3, 50e-3)](std::mt19937& random) {
    return random() % 10 < 3 ? slow(random) : usual_(random);  // a machine that is often busy
  };
  for (const Delay& delay : {usual_, exponential(0.2e-3, 0.5e-3), Delay(busy)}) {
    for (const int samples : {20, 50, 300}) {
      int within = 0;
      constexpr int kRuns = 300;
      double sum_sigma_s = 0;
      double sum_error_s = 0;
      for (int run = 0; run < kRuns; ++run) {
        restart(static_cast<unsigned>(run));
        drift_ = std::normal_distribution<double>(0, kDriftFollowed)(random_);
        now_ = kStart;
        query(samples, delay, delay);
        within += std::abs(error_s(now_)) < 2 * filter_.at(now_).sigma_s ? 1 : 0;
        sum_sigma_s += filter_.at(now_).sigma_s;
        sum_error_s += std::abs(error_s(now_));
      }
      RecordProperty("within_" + std::to_string(samples), within);
      EXPECT_GE(within, kRuns * 90 / 100)
          << samples << " samples, mean sigma " << sum_sigma_s / kRuns << " s, mean error "
          << sum_error_s / kRuns << " s";
      EXPECT_LT(sum_sigma_s, 4 * sum_error_s) << samples << " samples";
    }
  }
}

TEST_F(ClockFilterTest, BoundHoldsForUnequalDelays) {
  query(300, uniform(9e-3, 0.5e-3), uniform(1e-3, 0.5e-3));
  EXPECT_NEAR(error_s(now_), 4e-3, 0.5e-3) << "half the difference, which is not observable";
  EXPECT_LT(std::abs(error_s(now_)), filter_.at(now_).bound_s);
}

TEST_F(ClockFilterTest, IsNotDisturbedByCongestion) {
  const auto jam = exponential(5e-3, 100e-3);
  query(300);
  for (int i = 0; i < 150; ++i) {
    query(jam, i % 2 == 0 ? jam : usual_);
    EXPECT_LT(std::abs(error_s(now_)), 2 * kRequired_s);
  }
}

TEST_F(ClockFilterTest, StartsAgainWhenAClockIsSet) {
  for (const Nanoseconds step : {3600 * kSecond, -kSecond, 20 * kMillisecond, -20 * kMillisecond}) {
    query(300);
    offset_ += step;
    query(50);
    EXPECT_NEAR(error_s(now_), 0, 2 * kRequired_s) << "set by " << step << " ns";
    EXPECT_LE(filter_.at(now_).samples, 60);
  }
}

TEST_F(ClockFilterTest, FrozenServerClockIsNeverKnown) {
  for (int i = 0; i < 100; ++i) {
    filter_.add({now_, 5, 5, now_ + kMillisecond});
    now_ += 100 * kMillisecond;
    EXPECT_FALSE(filter_.at(now_).known);
  }
}

TEST_F(ClockFilterTest, IgnoresImpossibleReplies) {
  filter_.add({10, 100, 90, 20});   // sent before the query came
  filter_.add({10, 100, 200, 20});  // longer in the server than away
  filter_.add({20, 100, 100, 10});  // back before it was sent
  EXPECT_EQ(filter_.at(100).samples, 0);
}

TEST_F(ClockFilterTest, ForgetsSamplesOutsideOfItsWindow) {
  query(320);
  EXPECT_EQ(filter_.at(now_).samples, 320);
  now_ += 60 * kSecond;
  query(1);
  EXPECT_LE(filter_.at(now_).samples, 1);
}

}  // namespace
}  // namespace fiducap::sdk
