#include "src/clock_filter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace fiducap::sdk {
namespace {

// The requirement: 95 % of all estimates within this of the truth, on a way of 5 ms ± 2 ms.
constexpr double kRequired_s = 300e-6;
constexpr Nanoseconds kPause = 100 * kMillisecond;
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
  void ask(const Delay& there, const Delay& back) {
    const auto span = [&](const Delay& delay) {
      return static_cast<Nanoseconds>(delay(random_) * 1e9);
    };
    const Nanoseconds came = now_ + span(there);
    const Nanoseconds went = came + 20'000;  // the server takes 20 µs
    filter_.add({now_, server_of(came), server_of(went), went + span(back)});
    now_ += kPause;
  }
  /// Absolute errors just before each further answer, sorted.
  std::vector<double> errors_over(int samples, const Delay& there, const Delay& back) {
    std::vector<double> errors;
    for (int i = 0; i < samples; ++i) {
      errors.push_back(std::abs(error_s(now_)));
      ask(there, back);
    }
    std::sort(errors.begin(), errors.end());
    return errors;
  }
  static double p95(const std::vector<double>& sorted) { return sorted[sorted.size() * 95 / 100]; }

  static constexpr Nanoseconds kStart = 1000 * kSecond;
  Nanoseconds now_ = kStart;
  Nanoseconds offset_ = -86'400 * kSecond + 123'456'789;
  double drift_ = 0;
  std::mt19937 random_{1};  // NOLINT: the same numbers in every run
  ClockFilter filter_;
};

TEST_F(ClockFilterTest, KnowsNothingBeforeFourSamples) {
  const auto way = uniform(1e-3, 0.1e-3);
  for (int i = 0; i < 3; ++i) {
    ask(way, way);
    EXPECT_FALSE(filter_.at(now_).known);
  }
  ask(way, way);
  EXPECT_TRUE(filter_.at(now_).known);
  EXPECT_EQ(filter_.at(now_).samples, 4);
}

TEST_F(ClockFilterTest, IsExactOnAWayWithoutJitter) {
  const auto way = uniform(5e-3, 0);
  for (int i = 0; i < 50; ++i) ask(way, way);
  constexpr double kRounding_s = 10e-9;
  EXPECT_NEAR(error_s(now_), 0, kRounding_s);
  EXPECT_NEAR(filter_.at(now_).round_trip_s, 10e-3, 1e-6);
}

TEST_F(ClockFilterTest, StaysWithin300MicrosecondsOnFiveMillisecondsPlusMinusTwo) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    random_.seed(seed);
    filter_.reset();
    const auto way = uniform(5e-3, 2e-3);
    for (int i = 0; i < 50; ++i) ask(way, way);  // five seconds to find it
    EXPECT_LT(p95(errors_over(600, way, way)), kRequired_s) << "seed " << seed;
  }
}

TEST_F(ClockFilterTest, FollowsADriftOf50ppm) {
  for (const double drift : {kDriftFollowed, -kDriftFollowed}) {
    for (unsigned seed = 1; seed <= 10; ++seed) {
      random_.seed(seed);
      filter_.reset();
      drift_ = drift;
      const auto way = uniform(5e-3, 2e-3);
      for (int i = 0; i < 50; ++i) ask(way, way);
      EXPECT_LT(p95(errors_over(1200, way, way)), kRequired_s) << "seed " << seed;
      constexpr double kDriftError = 10e-6;  // 2 min of this jitter
      EXPECT_NEAR(filter_.at(now_).drift, drift, kDriftError) << "seed " << seed;
    }
  }
}

TEST_F(ClockFilterTest, FollowsADriftThatChangesWithTemperature) {
  const auto way = uniform(5e-3, 2e-3);
  std::vector<double> errors;
  for (int i = 0; i < 3000; ++i) {
    offset_ += static_cast<Nanoseconds>(kDriftFollowed * std::sin(2 * M_PI * i / 3000) *
                                        1e8);  // 5 min period
    if (i > 100) errors.push_back(std::abs(error_s(now_)));
    ask(way, way);
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(p95(errors), kRequired_s);
}

TEST_F(ClockFilterTest, ItsSigmaIsHonest) {
  // Share of errors below two sigmas over many runs; a Gaussian would give 95 %. Much less is a
  // lie, all would be a sigma without meaning.
  const auto jammed = [quick = uniform(5e-3, 2e-3),
                       slow = exponential(5e-3, 50e-3)](std::mt19937& random) {
    return random() % 10 < 3 ? slow(random)
                             : quick(random);  // a machine that is too busy now and then
  };
  for (const Delay& way : {uniform(5e-3, 2e-3), exponential(0.2e-3, 0.5e-3), Delay(jammed)}) {
    for (const int samples : {20, 50, 300}) {
      int within = 0;
      constexpr int kRuns = 300;
      double sum_sigma_s = 0;
      double sum_error_s = 0;
      for (int run = 0; run < kRuns; ++run) {
        random_.seed(static_cast<unsigned>(run));
        filter_.reset();
        drift_ = std::normal_distribution<double>(0, kDriftFollowed)(random_);
        now_ = kStart;
        for (int i = 0; i < samples; ++i) ask(way, way);
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

TEST_F(ClockFilterTest, ItsBoundHoldsForWaysOfDifferentLength) {
  const auto there = uniform(9e-3, 0.5e-3);
  const auto back = uniform(1e-3, 0.5e-3);
  for (int i = 0; i < 300; ++i) ask(there, back);
  EXPECT_NEAR(error_s(now_), 4e-3, 0.5e-3) << "half the difference of the ways: nobody can see it";
  EXPECT_LT(std::abs(error_s(now_)), filter_.at(now_).bound_s);
}

TEST_F(ClockFilterTest, IsNotDisturbedByACongestedMinute) {
  const auto way = uniform(5e-3, 2e-3);
  const auto jam = exponential(5e-3, 100e-3);
  for (int i = 0; i < 300; ++i) ask(way, way);
  for (int i = 0; i < 150; ++i) {
    ask(jam, i % 2 == 0 ? jam : way);
    EXPECT_LT(std::abs(error_s(now_)), 2 * kRequired_s);
  }
}

TEST_F(ClockFilterTest, StartsAgainWhenAClockIsSet) {
  const auto way = uniform(5e-3, 2e-3);
  for (const Nanoseconds step : {3600 * kSecond, -kSecond, 20 * kMillisecond, -20 * kMillisecond}) {
    for (int i = 0; i < 300; ++i) ask(way, way);
    offset_ += step;
    for (int i = 0; i < 50; ++i) ask(way, way);
    EXPECT_NEAR(error_s(now_), 0, 2 * kRequired_s) << "set by " << step << " ns";
    EXPECT_LE(filter_.at(now_).samples, 60);
  }
}

TEST_F(ClockFilterTest, AFrozenServerClockIsNeverKnown) {
  for (int i = 0; i < 100; ++i) {
    filter_.add({now_, 5, 5, now_ + kMillisecond});
    now_ += kPause;
    EXPECT_FALSE(filter_.at(now_).known);
  }
}

TEST_F(ClockFilterTest, IgnoresAnswersThatCannotBe) {
  filter_.add({10, 100, 90, 20});   // answered before it came
  filter_.add({10, 100, 200, 20});  // took longer there than away
  filter_.add({20, 100, 100, 10});  // back before it went
  EXPECT_EQ(filter_.at(100).samples, 0);
}

TEST_F(ClockFilterTest, ForgetsWhatIsOlderThanItsWindow) {
  const auto way = uniform(5e-3, 2e-3);
  for (int i = 0; i < 320; ++i) ask(way, way);
  EXPECT_EQ(filter_.at(now_).samples, 320);
  now_ += 60 * kSecond;
  ask(way, way);
  EXPECT_LE(filter_.at(now_).samples, 1);
}

}  // namespace
}  // namespace fiducap::sdk
