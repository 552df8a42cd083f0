#include "capture/lens/camera_model.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <opencv2/calib3d.hpp>

#include "support/jacobian_check.hpp"
#include "support/lens_models.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

// Newton stops at 1e-12 of focal length 1; f < 2000 px.
constexpr double kRoundTrip_px = 1e-8;
// OpenCV projects in the same arithmetic.
constexpr double kSameFormula_px = 1e-9;

struct NamedCamera {
  const char* name;
  CameraModel model;
};
std::ostream& operator<<(std::ostream& out, const NamedCamera& camera) {
  return out << camera.name;
}

const NamedCamera kFisheye{"Fisheye",
                           equidistant({1280, 1024, 465.609, 465.632, 622.637, 513.902},
                                       {-0.0229515, 0.01625, -0.00961832, 0.00176252, 0})};
const NamedCamera kTangential{"RadTanWithTangential",
                              radial_tangential({1920, 1200, 1405.76, 1404.8, 958.042, 607.615},
                                                {-0.167373, 0.110745, 8.1e-5, 7.3e-5, -0.0286819})};
const NamedCamera kWebcam{"RadTanWebcam",
                          radial_tangential({1920, 1080, 1826.12, 1821.48, 983.16, 538.745},
                                            {0.161179, -0.819752, 0, 0, 0})};
const NamedCamera kEuroc{"RadTanStrongBarrel",
                         radial_tangential({752, 480, 458.654, 457.296, 367.215, 248.375},
                                           {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05})};
// An Azure Kinect and an OAK-D: numerator and denominator nearly cancel.
const NamedCamera kKinect{"RationalKinect", rational({1280, 720, 612.9, 612.7, 638.3, 367.2},
                                                     {0.4516, -2.5119, 0.00049, -0.00016, 1.4511,
                                                      0.3305, -2.3321, 1.3794})};
const NamedCamera kOak{"RationalOak", rational({1280, 720, 788.9, 788.9, 637.2, 365.8},
                                               {-2.5119, 17.4131, -0.00016, -0.00068, -16.8012,
                                                -2.6028, 17.5437, -16.9405})};
const NamedCamera kPlain{"NoDistortion", {752, 480, 460, 455, 376, 240}};

cv::Mat matrix_of(const CameraModel& c) {
  return (cv::Mat_<double>(3, 3) << c.fu, 0, c.cu, 0, c.fv, c.cv, 0, 0, 1);
}
cv::Mat coefficients_of(const CameraModel& c) {
  const int n = static_cast<int>(listed_coefficients(c).size());
  cv::Mat k(1, n, CV_64F);
  for (int i = 0; i < n; ++i) k.at<double>(i) = c.coefficients[static_cast<std::size_t>(i)];
  return k;
}

Eigen::Vector2d project_by_opencv(const CameraModel& c, const Eigen::Vector3d& p) {
  const std::vector<cv::Point3d> points{{p.x(), p.y(), p.z()}};
  std::vector<cv::Point2d> out;
  const cv::Vec3d zero(0, 0, 0);
  if (c.distortion == Distortion::kEquidistant) {
    cv::fisheye::projectPoints(points, out, zero, zero, matrix_of(c), coefficients_of(c));
  } else {
    cv::projectPoints(points, zero, zero, matrix_of(c), coefficients_of(c), out);
  }
  return {out[0].x, out[0].y};
}

Eigen::Vector3d ray_of(const CameraModel& c, const Eigen::Vector2d& ideal_px) {
  return {(ideal_px.x() - c.cu) / c.fu, (ideal_px.y() - c.cv) / c.fv, 1};
}

class LensTest : public testing::TestWithParam<NamedCamera> {
 protected:
  const CameraModel& camera() const { return GetParam().model; }

  // Visits a grid over the whole image, edges included, up to 1.45 rad off the axis: the corners
  // of the fisheye look backwards.
  template <typename Visit>
  int over_the_image(Visit visit) const {
    constexpr int kSteps = 24;
    const Eigen::Vector2d centre(camera().cu, camera().cv);
    const auto rim = camera().project({std::sin(1.449), 0, std::cos(1.449)});
    const double rim_px = rim ? (*rim - centre).norm() : 1e9;
    int visited = 0;
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; j <= kSteps; ++j) {
        const Eigen::Vector2d raw((camera().width - 1.0) * i / kSteps,
                                  (camera().height - 1.0) * j / kSteps);
        if ((raw - centre).norm() > rim_px) continue;
        ++visited;
        visit(raw);
      }
    }
    return visited;
  }
};

INSTANTIATE_TEST_SUITE_P(Cameras, LensTest,
                         testing::Values(kFisheye, kTangential, kWebcam, kEuroc, kKinect, kOak,
                                         kPlain),
                         [](const auto& tested) { return std::string(tested.param.name); });

TEST_P(LensTest, ProjectsAnUndistortedPixelToTheRawPixel) {
  const int visited = over_the_image([&](const Eigen::Vector2d& raw) {
    const auto ideal = undistort(camera(), raw).value();
    const auto back = camera().project(4.0 * ray_of(camera(), ideal.px)).value();
    EXPECT_NEAR((back - raw).norm(), 0, kRoundTrip_px) << raw.transpose();
  });
  EXPECT_GT(visited, 500);
}

TEST_P(LensTest, ProjectsLikeOpenCv) {
  over_the_image([&](const Eigen::Vector2d& raw) {
    const Eigen::Vector3d p = 2.5 * ray_of(camera(), undistort(camera(), raw).value().px);
    EXPECT_NEAR((camera().project(p).value() - project_by_opencv(camera(), p)).norm(), 0,
                kSameFormula_px);
  });
}

TEST_P(LensTest, JacobianAgreesWithCentralDifferences) {
  over_the_image([&](const Eigen::Vector2d& raw) {
    const auto f = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
      return undistort(camera(), raw + Eigen::Vector2d(d)).value().px;
    };
    // Differences over 0.02 px: truncation ~1e-8, rounding ~1e-10 / 0.02.
    expect_jacobian(undistort(camera(), raw).value().ideal_from_raw, f, 1e-6, 1e-2);
  });
}

TEST_P(LensTest, RejectsPointsBehindTheCameraAndInvalidNumbers) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.1, 0.1, -1), {0.1, 0.1, 0}, {0, 0, kNan}})
    EXPECT_FALSE(camera().project(p)) << p.transpose();
  EXPECT_FALSE(undistort(camera(), {kNan, 3}));
  EXPECT_FALSE(undistort(camera(), {3, std::numeric_limits<double>::infinity()}));
}

TEST(CameraModel, RefusesRaysBeyondTheGivenAngle) {
  const double angle = 0.5;
  const CameraModel& fisheye = kFisheye.model;
  const auto edge = [&](double theta) {
    return fisheye.project({std::sin(theta), 0, std::cos(theta)}).value();
  };
  EXPECT_TRUE(undistort(fisheye, edge(angle - 1e-6), angle));
  EXPECT_FALSE(undistort(fisheye, edge(angle + 1e-6), angle));
  const CameraModel& plain = kPlain.model;
  EXPECT_TRUE(undistort(plain, plain.pinhole({std::sin(angle - 1e-6), 0, std::cos(angle)}), angle));
  EXPECT_FALSE(undistort(plain, plain.pinhole({std::tan(angle + 1e-6), 0, 1}), angle));
}

// k1 = -0.3 alone: r (1 - 0.3 r²) has its summit at r = 1 / sqrt(0.9) with the value 2/3 r.
class FoldedLensTest : public testing::Test {
 protected:
  CameraModel camera_ = radial_tangential({800, 800, 400, 400, 400, 400}, {-0.3});
  const double summit_ = 1 / std::sqrt(0.9);
};

TEST_F(FoldedLensTest, UsesNoPointOrPixelBeyondTheSummit) {
  EXPECT_TRUE(camera_.project({summit_ - 1e-6, 0, 1}));
  EXPECT_FALSE(camera_.project({summit_ + 1e-6, 0, 1}));
  EXPECT_FALSE(camera_.project({30, 0, 1}));
  const double raw_summit_px = 400 * summit_ * 2 / 3;
  EXPECT_TRUE(undistort(camera_, {400 + raw_summit_px - 1e-3, 400}));
  EXPECT_FALSE(undistort(camera_, {400 + raw_summit_px + 1e-3, 400}));
}

TEST_F(FoldedLensTest, FindsAFoldBehindWhichThePolynomialRisesAgain) {
  camera_.coefficients = {-1.0, 0.4};  // slope 1 - 3s + 2s²: below zero only for r in 0.71 … 1
  EXPECT_TRUE(camera_.project({0.6, 0, 1}));
  EXPECT_FALSE(camera_.project({0.8, 0, 1}));
  EXPECT_FALSE(camera_.project({1.2, 0, 1}));  // rises here, but an inner point has the same pixel
}

TEST_F(FoldedLensTest, FindsTheFoldOfAnEquidistantLens) {
  camera_ = equidistant(camera_, {-0.3});
  for (const double off : {-1e-6, 1e-6}) {
    const double theta = summit_ + off;
    EXPECT_EQ(camera_.project({0, std::sin(theta), std::cos(theta)}).has_value(), off < 0);
  }
}

TEST(CameraModel, CheckNamesEveryBrokenRule) {
  CameraModel camera;
  camera.cu = std::numeric_limits<double>::quiet_NaN();
  camera.coefficients[1] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(paths_of(camera.check()),
              testing::ElementsAre("width", "height", "fu", "fv", "cu", "coefficients[1]"));
  camera = kFisheye.model;
  camera.coefficients[4] = 0.1;  // an equidistant lens has four
  EXPECT_THAT(paths_of(camera.check()), testing::ElementsAre("coefficients[4]"));
}

}  // namespace
}  // namespace fiducap
