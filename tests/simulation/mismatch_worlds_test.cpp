#include "simulation/mismatch_worlds.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "simulation/filter_run.hpp"
#include "simulation/mismatch_changes.hpp"

namespace fiducap {
namespace {

constexpr double kWorldSeconds = 10;
// Arithmetic only, no measurement.
constexpr double kExact = 1e-12;

/// The same seed without and with a mismatch.
struct Worlds {
  EstimationData clean, wrong;
  explicit Worlds(const std::string& name, const std::string& world = "sparse") {
    const SimulatedDataSetup setup{.world = world, .seconds = kWorldSeconds, .seed = 1};
    clean = unmodified_world(setup, mismatch_named(name));
    wrong = mismatched_world(setup, mismatch_named(name));
  }
};

template <class Sample>
std::vector<Sample> samples_of(const EstimationData& data) {
  std::vector<Sample> out;
  for (const SensorSample& sample : data.samples)
    if (const auto* one = std::get_if<Sample>(&sample)) out.push_back(*one);
  return out;
}
std::vector<CornerFrame> images_of(const EstimationData& data) {
  return samples_of<CornerFrame>(data);
}
std::vector<ImuSample> readings_of(const EstimationData& data) {
  return samples_of<ImuSample>(data);
}

/// Stamps of the second minus those of the first.
std::vector<double> stamp_errors(const Worlds& worlds) {
  const auto clean = images_of(worlds.clean);
  const auto wrong = images_of(worlds.wrong);
  std::vector<double> errors;
  for (std::size_t i = 0; i < std::min(clean.size(), wrong.size()); ++i)
    errors.push_back(to_seconds(wrong[i].exposed_at - clean[i].exposed_at));
  return errors;
}

double rms_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double x : values) sum += x * x;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

/// RMS motion of a tag's corners in images that show it in both worlds.
double moved_px(const Worlds& worlds, int tag_id, double from_s, double to_s) {
  const auto clean = images_of(worlds.clean);
  const auto wrong = images_of(worlds.wrong);
  const Instant first = time_of(worlds.clean.samples.front());
  std::vector<double> moves;
  for (std::size_t i = 0; i < clean.size(); ++i) {
    const double t_s = to_seconds(clean[i].exposed_at - first);
    if (t_s < from_s || t_s >= to_s) continue;
    for (const TagSighting& a : clean[i].tags) {
      for (const TagSighting& b : wrong[i].tags) {
        if (a.tag_id == tag_id && b.tag_id == tag_id)
          moves.push_back((a.corners_px[0] - b.corners_px[0]).norm());
      }
    }
  }
  return moves.empty() ? 0 : rms_of(moves);
}

/// Number of images with another set of ids.
int images_with_other_ids(const Worlds& worlds) {
  const auto ids = [](const CornerFrame& image) {
    std::set<int> all;
    for (const TagSighting& tag : image.tags) all.insert(tag.tag_id);
    return all;
  };
  const auto clean = images_of(worlds.clean);
  const auto wrong = images_of(worlds.wrong);
  int others = 0;
  for (std::size_t i = 0; i < clean.size(); ++i) others += ids(clean[i]) != ids(wrong[i]) ? 1 : 0;
  return others;
}

TEST(MismatchWorlds, AllRowsButTheFirstDifferFromTheirBase) {
  const auto differ = [](const EstimationData& a, const EstimationData& b) {
    if (a.samples.size() != b.samples.size()) return true;
    if (a.camera.model.fu != b.camera.model.fu || a.camera.model.cu != b.camera.model.cu)
      return true;
    if (a.tag_set.sizes_m != b.tag_set.sizes_m) return true;
    if ((a.nominal_X_BV.q.coeffs() - b.nominal_X_BV.q.coeffs()).norm() > kExact) return true;
    const auto images = images_of(a), others = images_of(b);
    for (std::size_t i = 0; i < images.size(); ++i) {
      if (images[i].exposed_at != others[i].exposed_at) return true;
      if (images[i].tags.size() != others[i].tags.size()) return true;
      for (std::size_t k = 0; k < images[i].tags.size(); ++k) {
        const TagSighting &s = images[i].tags[k], &t = others[i].tags[k];
        if (s.tag_id != t.tag_id || s.corners_px != t.corners_px) return true;
      }
    }
    const auto readings = readings_of(a), other_readings = readings_of(b);
    for (std::size_t i = 0; i < readings.size(); ++i) {
      if (readings[i].w_WB_B != other_readings[i].w_WB_B) return true;
      if (readings[i].f_B != other_readings[i].f_B) return true;
    }
    return false;
  };
  for (const Mismatch& mismatch : mismatches()) {
    const Worlds worlds(mismatch.name);
    EXPECT_EQ(differ(worlds.clean, worlds.wrong), mismatch.name != "nothing") << mismatch.name;
    EXPECT_EQ(worlds.clean.reference_tag, worlds.wrong.reference_tag) << mismatch.name;
  }
}

TEST(MismatchWorlds, ImuIsFiveTimesNoisierThanConfigured) {
  const Worlds worlds("IMU x5");
  const auto scatter = [](const EstimationData& data) {
    std::vector<double> errors;
    for (const ImuSample& imu : readings_of(data)) {
      const Eigen::Vector3d w = data.rate_at(imu.sampled_at);
      errors.push_back((imu.w_WB_B - w - data.truth_near(imu.sampled_at).bias_w).x());
    }
    return rms_of(errors);
  };
  constexpr double kOfFive = 0.2;  // 2000 readings scatter by 2 %, differences of rates are coarse
  EXPECT_NEAR(scatter(worlds.wrong) / scatter(worlds.clean), 5, kOfFive);
  EXPECT_EQ(worlds.wrong.imu->gyro_noise_rad_s_rtHz, worlds.clean.imu->gyro_noise_rad_s_rtHz);
}

TEST(MismatchWorlds, StampsAreOffAsNamed) {
  constexpr double kOfThree_s = 0.0006;  // four sigmas of 200 draws
  EXPECT_NEAR(rms_of(stamp_errors(Worlds("stamps 3 ms"))), 0.003, kOfThree_s);
  const auto jump = stamp_errors(Worlds("jump 0.2 s"));
  EXPECT_NEAR(jump.front(), 0, kExact);
  EXPECT_NEAR(jump.back(), 0.2, kExact);
  EXPECT_NEAR(stamp_errors(Worlds("0.5 s latency declared")).front(), -0.5, kExact);
  EXPECT_NEAR(stamp_errors(Worlds("0.5 s latency undeclared")).front(), 0.5, kExact);
}

TEST(MismatchWorlds, ConfigurationIsOffAsNamed) {
  const auto size_ratio = [](const EstimationData& data, int tag_id) {
    return data.tag_set.edge_of(tag_id) / data.tag(tag_id)->edge_m;
  };
  const Worlds all("prints 2 %"), one("one print 2 %");
  const int tag_id = most_seen_tag(one.clean);
  for (const RecordedTag& tag : all.clean.tags) {
    EXPECT_NEAR(size_ratio(all.wrong, tag.tag_id), 1 / 1.02, kExact);
    EXPECT_NEAR(size_ratio(one.wrong, tag.tag_id), tag.tag_id == tag_id ? 1 / 1.02 : 1, kExact);
  }
  const Worlds lens("both lens");
  EXPECT_NEAR(lens.wrong.camera.model.fu / lens.clean.camera.model.fu, 1.01, kExact);
  EXPECT_NEAR(std::hypot(lens.wrong.camera.model.cu - lens.clean.camera.model.cu,
                         lens.wrong.camera.model.cv - lens.clean.camera.model.cv),
              5, kExact);
  const Worlds turned("camera turned 90 deg");
  const auto angle = turned.clean.nominal_X_BV.q.angularDistance(turned.wrong.nominal_X_BV.q);
  EXPECT_NEAR(angle, std::acos(0), 1e-7);  // acos near its end
}

TEST(MismatchWorlds, RollingShutterMovesCornersUnconfigured) {
  const Worlds worlds("readout 15 ms");
  EXPECT_GT(moved_px(worlds, most_seen_tag(worlds.clean), 0, kWorldSeconds), 0.5);
  EXPECT_EQ(worlds.wrong.camera.readout_s, 0);
}

TEST(MismatchWorlds, BlurScattersFastCornersOnly) {
  const Worlds slow("blur 20 ms", "table"), fast("blur 20 ms", "sparse");
  const double slow_px = moved_px(slow, most_seen_tag(slow.clean), 0, kWorldSeconds);
  const double fast_px = moved_px(fast, most_seen_tag(fast.clean), 0, kWorldSeconds);
  EXPECT_GT(slow_px, 0.05);
  EXPECT_GT(fast_px, 1.2 * slow_px);
}

TEST(MismatchWorlds, TagIsMisreadInTheFirstSecond) {
  for (const char* name : {"misread id", "misread reference"}) {
    SCOPED_TRACE(name);
    const Worlds worlds(name);
    const auto clean = images_of(worlds.clean);
    const auto wrong = images_of(worlds.wrong);
    const int others = images_with_other_ids(worlds);
    EXPECT_GE(others, 1);
    EXPECT_LE(others, 2);
    EXPECT_EQ(clean.size(), wrong.size());
    const int late = std::string(name) == "misread id" ? mismatch::late_tag(worlds.clean)
                                                       : worlds.clean.reference_tag;
    for (const CornerFrame& image : clean) {
      if (to_seconds(image.exposed_at - clean.front().exposed_at) >= 1.0) break;
      for (const TagSighting& tag : image.tags) EXPECT_NE(tag.tag_id, late);
    }
  }
}

TEST(MismatchWorlds, DoorMovesItsTagAfterAThird) {
  const Worlds worlds("door");
  const int tag_id = most_seen_tag(worlds.clean);
  EXPECT_EQ(moved_px(worlds, tag_id, 0, kWorldSeconds / 3 - 0.1), 0);
  EXPECT_GT(moved_px(worlds, tag_id, kWorldSeconds / 3, kWorldSeconds), 20);
}

TEST(MismatchWorlds, SecondPrintIsSeen) {
  const Worlds worlds("id twice");
  EXPECT_GT(images_with_other_ids(worlds), 20);
}

TEST(MismatchWorlds, TwoPrintsAreExchangedInTheMiddle) {
  const Worlds worlds("two prints swapped");
  const std::vector<int> two = mismatch::often_seen(worlds.clean, 2);
  ASSERT_EQ(two.size(), 2U);
  const auto clean = images_of(worlds.clean);
  const auto wrong = images_of(worlds.wrong);
  int exchanged = 0;
  for (std::size_t i = 0; i < clean.size(); ++i) {
    for (const TagSighting& a : clean[i].tags) {
      for (const TagSighting& b : wrong[i].tags) {
        if (a.corners_px != b.corners_px || a.tag_id == b.tag_id) continue;
        EXPECT_EQ(a.tag_id + b.tag_id, two[0] + two[1]);
        EXPECT_GE(2 * i + 2, clean.size());
        ++exchanged;
      }
    }
  }
  EXPECT_GT(exchanged, 20);
}

TEST(MismatchWorlds, ImagesAreDroppedOrEmpty) {
  const Worlds dropped("3rd image dropped");
  EXPECT_EQ(images_of(dropped.wrong).size(),
            images_of(dropped.clean).size() - images_of(dropped.clean).size() / 3);
  const Worlds family("wrong family");
  for (const CornerFrame& image : images_of(family.wrong)) EXPECT_TRUE(image.tags.empty());
}

TEST(MismatchWorlds, ImuIsClippedOrWired) {
  const auto most = [](const EstimationData& data) {
    double rate = 0;
    for (const ImuSample& imu : readings_of(data))
      rate = std::max(rate, imu.w_WB_B.cwiseAbs().maxCoeff());
    return rate;
  };
  const Worlds clipped("IMU clipped");
  EXPECT_NEAR(most(clipped.wrong), 0.7 * most(clipped.clean), kExact);
  const Worlds wired("gyro axes swapped");
  const ImuSample a = readings_of(wired.clean).back();
  const ImuSample b = readings_of(wired.wrong).back();
  EXPECT_EQ(b.w_WB_B, Eigen::Vector3d(a.w_WB_B.y(), a.w_WB_B.x(), a.w_WB_B.z()));
  EXPECT_EQ(b.f_B, Eigen::Vector3d(a.f_B.y(), a.f_B.x(), a.f_B.z()));
}

TEST(MismatchWorlds, RunListsEachReportOnce) {
  EstimationData data = simulate({.world = "table", .seconds = kWorldSeconds, .seed = 1});
  for (SensorSample& sample : data.samples)
    if (auto* imu = std::get_if<ImuSample>(&sample)) imu->f_B /= 9.81;
  const FilterRun run = run_filter(data, {.filter = "world", .live = true});
  const auto in_g = [](const std::string& text) { return text.find(" g") != std::string::npos; };
  EXPECT_TRUE(std::any_of(run.said.begin(), run.said.end(), in_g));
  const std::set<std::string> once(run.said.begin(), run.said.end());
  EXPECT_EQ(once.size(), run.said.size());
}

}  // namespace
}  // namespace fiducap
