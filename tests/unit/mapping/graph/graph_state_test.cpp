#include "mapping/graph/graph_state.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

using namespace segment_layout;  // NOLINT: the block names are the subject of this file

SegmentSensors one_camera(double focal_sigma) {
  SegmentSensors sensors;
  sensors.has_imu = true;
  sensors.cameras.resize(1);
  sensors.cameras[0].focal_sigma = focal_sigma;
  return sensors;
}

/// What a filter has found, its lens a little off what is configured.
std::vector<CameraBelief> found_lens() {
  CameraBelief camera;
  camera.lens.focal = 1e-4;
  camera.lens_is_open = true;
  return {camera};
}

double focal_sigma(const GraphBody& body) {
  return 1 / std::sqrt(body.information(kFocal, kFocal));
}

TEST(GraphBody, ALensThatIsToldAsUncertainStaysAsUncertainAsItIsTold) {
  GraphBody body = body_by_configuration(1, one_camera(5e-4));
  initialise_cameras(found_lens(), body);
  EXPECT_NEAR(focal_sigma(body), 5e-4, 1e-12);
}

TEST(GraphBody, ALensThatIsToldAsExactAndFoundToBeWrongIsUnknown) {
  GraphBody body = body_by_configuration(1, one_camera(0));
  EXPECT_LT(focal_sigma(body), 1e-6);
  initialise_cameras(found_lens(), body);
  EXPECT_NEAR(focal_sigma(body), 0.1, 1e-9);
}

}  // namespace
}  // namespace fiducap
