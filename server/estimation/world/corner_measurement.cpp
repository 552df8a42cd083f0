#include "estimation/world/corner_measurement.hpp"

#include "base/so3.hpp"
#include "estimation/world/camera_moment.hpp"

namespace fiducap::world {

namespace {

void add_pose(TagMeasurement& m, int at, const Matrix86d& H) {
  m.add(at, H.leftCols<3>());
  m.add(at + 3, H.rightCols<3>());
}

/// ∂ predicted / ∂ the tag's world-side error; the camera's enters with the opposite sign.
/// @param H_VT  what corner_residual() says
Matrix86d on_tag(const Matrix86d& H_VT, const Eigen::Matrix3d& R_VW, const Eigen::Vector3d& p_WT) {
  Matrix86d H;
  H.leftCols<3>() = H_VT.leftCols<3>() * R_VW;
  H.rightCols<3>() = H_VT.rightCols<3>() * R_VW - H.leftCols<3>() * skew(p_WT);
  return H;
}

/// Compares some corners (rows `first` … of the measurement) with the camera as it stood when they
/// were exposed.
void compare(const FilterState& state, int camera, const CameraAt& at,
             const CornerResidual& residual, const TagToUse& tag, Eigen::Index first,
             Eigen::Index rows, TagMeasurement& m) {
  m.in_front = m.in_front && residual.in_front;
  m.y.segment(first, rows) = residual.y.segment(first, rows);
  Matrix86d H = Matrix86d::Zero();
  H.middleRows(first, rows) =
      on_tag(residual.H, at.X_WV.rotation().transpose(), place_of(state, tag).p)
          .middleRows(first, rows);
  if (tag.local >= 0) add_pose(m, state.tag_at(static_cast<std::size_t>(tag.local)), H);
  add_pose(m, layout::camera(camera), at.moved() ? Matrix86d(-H * at.on_camera) : Matrix86d(-H));
  if (at.moved()) {
    add_pose(m, layout::kPosition, -H * at.on_body);
    m.add(layout::kVelocity, -H * at.on_velocity);
    m.add(layout::kBiasW, -H * at.on_gyro_bias);
  }
  if (!state.clock_is_open(camera)) return;
  Matrix83d clock = Matrix83d::Zero();
  clock.col(0) = -H * at.on_time;
  for (Eigen::Index k = first; k < first + rows; ++k)
    clock(k, 1) = tag.seen->rows[static_cast<std::size_t>(k / 2)] * clock(k, 0);
  m.add(layout::clock(camera), clock);
}

/// Whether all rows of the camera's images are exposed at once, for certain.
bool has_one_moment(const FilterState& state, int camera) {
  const int readout = layout::clock(camera) + 1;
  return state.clocks[static_cast<std::size_t>(camera)].readout_s == 0 &&
         state.P()(readout, readout) == 0;
}

}  // namespace

const Pose& place_of(const FilterState& state, const TagToUse& tag) {
  return tag.local >= 0 ? state.tags[static_cast<std::size_t>(tag.local)].X_WT : tag.known->X_WT;
}

TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model,
                       const TagToUse& tag, double corner_noise_px) {
  TagMeasurement m;
  m.tag_id = tag.seen->tag_id;
  m.R = Matrix8d::Identity() * corner_noise_px * corner_noise_px;
  const CameraClock& clock = state.clocks[static_cast<std::size_t>(camera)];
  const auto compare_at = [&](double row, Eigen::Index first, Eigen::Index rows) {
    const CameraAt at = camera_at(state, camera, clock.seconds_to(row));
    const CornerResidual residual =
        corner_residual(*tag.seen, at.X_WV.inverse() * place_of(state, tag), model);
    compare(state, camera, at, residual, tag, first, rows, m);
  };
  if (clock.readout_s == 0) {
    compare_at(0, 0, 8);
  } else {
    for (Eigen::Index i = 0; i < 4; ++i)
      compare_at(tag.seen->rows[static_cast<std::size_t>(i)], 2 * i, 2);
  }
  return m;
}

void measure_image(const FilterState& state, int camera, const CameraModel& model,
                   std::span<const TagToUse> tags, const CornerNoise& noise,
                   ImageMeasurement& out) {
  out.shared.term_count = 0;
  out.tags.resize(tags.size());
  if (!has_one_moment(state, camera)) {
    for (std::size_t i = 0; i < tags.size(); ++i)
      out.tags[i] = measure(state, camera, model, tags[i], noise.of(*tags[i].seen));
    return;
  }
  const CameraAt at =
      camera_at(state, camera, state.clocks[static_cast<std::size_t>(camera)].seconds_to(0));
  out.shared = error_of(at, camera);
  const Pose X_VW = at.X_WV.inverse();
  const Eigen::Matrix3d R_VW = X_VW.rotation();
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const TagToUse& tag = tags[i];
    const Pose& X_WT = place_of(state, tag);
    const CornerResidual residual = corner_residual(*tag.seen, X_VW * X_WT, model);
    TagMeasurement& m = out.tags[i];
    m.tag_id = tag.seen->tag_id;
    m.y = residual.y;
    m.in_front = residual.in_front;
    m.relative = true;
    m.own =
        tag.local >= 0 ? state.tag_at(static_cast<std::size_t>(tag.local)) : TagMeasurement::kGiven;
    m.H = on_tag(residual.H, R_VW, X_WT.p);
    m.noise_px = noise.of(*tag.seen);
    m.block_count = 0;
  }
}

}  // namespace fiducap::world
