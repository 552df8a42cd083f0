// What libapriltag finds in rendered images, against where the corners truly are.
#include <apriltag/apriltag.h>
#include <apriltag/common/zarray.h>
#include <apriltag/tag36h11.h>
#include <gtest/gtest.h>

#include <cmath>

#include "simulation/random.hpp"
#include "simulation/room_shape.hpp"
#include "still_camera.hpp"

namespace fiducap::simulation {
namespace {

// AprilTag's own corner error is 0.05 px RMS per axis in clean images of this kind; a renderer that
// places edges wrongly adds to it.
constexpr double kMeanBias_px = 0.02;
constexpr double kRms_px = 0.15;
constexpr double kSmallestSide_px = 40;

using Corners = std::array<Eigen::Vector2d, 4>;

class Detector final {
 public:
  Detector() : family_(tag36h11_create()), detector_(apriltag_detector_create()) {
    apriltag_detector_add_family_bits(detector_, family_, 0);
    detector_->quad_decimate = 1;
    detector_->refine_edges = true;
  }
  ~Detector() {
    apriltag_detector_destroy(detector_);
    tag36h11_destroy(family_);
  }
  Detector(const Detector&) = delete;
  Detector& operator=(const Detector&) = delete;

  std::map<int, Corners> detect(const GrayImage& image) {
    image_u8_t view{image.width, image.height, image.width,
                    const_cast<std::uint8_t*>(image.pixels.data())};
    zarray_t* found = apriltag_detector_detect(detector_, &view);
    std::map<int, Corners> corners;
    for (int i = 0; i < zarray_size(found); ++i) {
      apriltag_detection_t* one = nullptr;
      zarray_get(found, i, &one);
      // AprilTag counts pixel edges, we count centres.
      for (std::size_t c = 0; c < 4; ++c)
        corners[one->id][c] = {one->p[c][0] - 0.5, one->p[c][1] - 0.5};
    }
    apriltag_detections_destroy(found);
    return corners;
  }

 private:
  apriltag_family_t* family_;
  apriltag_detector_t* detector_;
};

/// Corners by a detector that fits a line to the middle part of each bent side and intersects the
/// lines. Without a lens they are the true ones.
std::optional<Corners> straightened(const CameraModel& model, const Pose& X_VW,
                                    const RecordedTag& tag) {
  const auto corner = corners_of(tag);
  std::array<Eigen::Vector3d, 4> line;
  for (std::size_t side = 0; side < 4; ++side) {
    constexpr int kPoints = 33;
    Eigen::Matrix<double, 2, kPoints> points;
    for (int i = 0; i < kPoints; ++i) {
      const double share = (1 + i) / (kPoints + 1.0);
      const auto px = model.project(
          X_VW * ((1 - share) * corner[side] + share * corner[(side + 1) % 4]).eval());
      if (!px) return std::nullopt;
      points.col(i) = *px;
    }
    const Eigen::Vector2d mean = points.rowwise().mean();
    const Eigen::Matrix2d scatter =
        (points.colwise() - mean) * (points.colwise() - mean).transpose();
    const double angle = 0.5 * std::atan2(2 * scatter(0, 1), scatter(0, 0) - scatter(1, 1));
    const Eigen::Vector2d normal(-std::sin(angle), std::cos(angle));
    line[side] = {normal.x(), normal.y(), -normal.dot(mean)};
  }
  Corners met;
  for (std::size_t i = 0; i < 4; ++i) met[i] = line[(i + 3) % 4].cross(line[i]).hnormalized();
  return met;
}

bool well_inside(const CameraModel& model, const Corners& corners) {
  constexpr double kQuietZone_px = 14;  // white border of the largest tag here
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d& px = corners[i];
    const Eigen::Vector2d other(model.width - 1 - px.x(), model.height - 1 - px.y());
    if (px.cwiseMin(other).minCoeff() < kQuietZone_px ||
        (corners[(i + 1) % 4] - px).norm() < kSmallestSide_px)
      return false;
  }
  return true;
}

/// Six tags before a camera whose pose differs in each image.
struct Scene {
  std::vector<RecordedTag> tags;
  Pose X_WV;
};

Scene scene(std::uint64_t k) {
  Random random(k, Purpose::kMotion);
  Scene made;
  for (int i = 0; i < 6; ++i) {
    RecordedTag tag = tag_at(static_cast<int>(6 * (k % 90)) + i, 0.2,
                             {0.36 * (i % 3 - 1), 0.34 * (i / 3 - 0.5), 0});
    tag.X_WT.q =
        exp_so3({random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), random.uniform(-3, 3)});
    made.tags.push_back(tag);
  }
  made.X_WV = facing_camera(random.uniform(0.78, 0.85));
  made.X_WV.p += 0.05 * random.normal3();
  made.X_WV.q = made.X_WV.q * exp_so3(0.03 * random.normal3());
  return made;
}

struct Errors {
  Eigen::Vector2d mean{Eigen::Vector2d::Zero()};
  double rms{};
  int corners{}, expected{};
};

Errors measure(const CameraModel& model, const CameraSimulation& settings,
               const Eigen::Vector3d& rate, int images) {
  StillCamera camera(model, settings);
  Detector detector;
  Errors errors;
  for (std::uint64_t k = 0; k < static_cast<std::uint64_t>(images); ++k) {
    const Scene now = scene(k);
    const auto image =
        camera.photograph(EvenMotion(now.X_WV, Eigen::Vector3d::Zero(), rate), now.tags, k);
    const auto found = detector.detect(*image);
    for (const RecordedTag& tag : now.tags) {
      const auto expected = straightened(model, now.X_WV.inverse(), tag);
      if (!expected || !well_inside(model, *expected)) continue;
      ++errors.expected;
      const auto seen = found.find(tag.tag_id);
      if (seen == found.end()) continue;
      for (std::size_t i = 0; i < 4; ++i) {
        const Eigen::Vector2d error = seen->second[i] - (*expected)[i];
        errors.mean += error;
        errors.rms += 0.5 * error.squaredNorm();
        ++errors.corners;
      }
    }
  }
  errors.mean /= errors.corners;
  errors.rms = std::sqrt(errors.rms / errors.corners);
  return errors;
}

void expect_true_corners(const Errors& errors) {
  EXPECT_GT(errors.corners, 4 * errors.expected * 95 / 100);
  EXPECT_LT(errors.mean.cwiseAbs().maxCoeff(), kMeanBias_px) << errors.mean.transpose();
  EXPECT_LT(errors.rms, kRms_px);
  ::testing::Test::RecordProperty("corners", errors.corners);
  std::printf("             %d corners of %d tags, bias %.4f %.4f px, RMS %.4f px\n",
              errors.corners, errors.expected, errors.mean.x(), errors.mean.y(), errors.rms);
}

TEST(RenderedCorners, AreExactThroughEveryLens) {
  for (const auto& [name, lens] :
       {std::pair("none", small_camera()), std::pair("radial-tangential", small_lens_camera()),
        std::pair("fisheye", small_fisheye_camera())}) {
    SCOPED_TRACE(name);
    expect_true_corners(measure(lens, CameraSimulation{}, Eigen::Vector3d::Zero(), 30));
  }
}

TEST(RenderedCorners, AreOfTheMiddleOfTheExposure) {
  // 1 rad/s over 10 ms smears by 2.3 px; an image stamped at the start or end of it would be off
  // by 1.15 px.
  CameraSimulation settings;
  settings.exposure_s = 0.01;
  expect_true_corners(measure(small_camera(), settings, {0.2, 1.0, 0.1}, 30));
}

}  // namespace
}  // namespace fiducap::simulation
