#include "estimation/world/corner_measurement.hpp"

namespace fiducap::world {

CameraAt camera_at(const MovingBody& body, const Pose& X_BV, double seconds) {
  CameraAt out;
  out.seconds = seconds;
  const Pose X_WB = out.moved() ? body.X_WB_after(seconds) : body.X_WB;
  const Eigen::Vector3d w_B = body.gyro_B - body.bias_w;
  const Eigen::Vector3d w_W = X_WB.q * w_B;
  out.X_WV = X_WB * X_BV;
  out.on_time << body.v_WB + seconds * body.a_WB - w_W.cross(X_WB.p), w_W;
  if (!out.moved()) return out;
  // The error of a t²/2 is below a micrometre.
  out.on_camera = adjoint(X_WB * body.X_WB.inverse());
  out.on_body = Matrix6d::Identity() - out.on_camera;
  out.on_velocity.topRows<3>() = seconds * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d turn = -seconds * (X_WB.rotation() * right_jacobian_so3(seconds * w_B));
  out.on_gyro_bias << skew(X_WB.p) * turn, turn;
  return out;
}

SharedPose error_of(const CameraAt& at, int camera) {
  SharedPose out;
  Matrix63d on_clock = Matrix63d::Zero();
  on_clock.col(0) = at.on_time;
  out.add(layout::camera(camera), at.on_camera.leftCols<3>());
  out.add(layout::camera(camera) + 3, at.on_camera.rightCols<3>());
  out.add(layout::clock(camera), on_clock);
  if (!at.moved()) return out;
  out.add(layout::kPosition, at.on_body.leftCols<3>());
  out.add(layout::kAttitude, at.on_body.rightCols<3>());
  out.add(layout::kVelocity, at.on_velocity);
  out.add(layout::kBiasW, at.on_gyro_bias);
  return out;
}

TagCorners corners_of(const CameraAt& at, const EstimatedLens& lens, const TagObservation& seen,
                      const Pose& X_WT, double size) {
  const Pose X_VW = at.X_WV.inverse();
  const double zoom = 1 + lens.offset.focal;
  const Eigen::Vector2d centre(lens.model.cu, lens.model.cv);
  const CornerResidual residual =
      corner_residual(seen, X_VW * X_WT, lens.model, size, lens.offset.k1);
  TagCorners out{residual.y, residual.in_front, {}, {}, zoom * residual.H_size};
  const Matrix86d H_VT = zoom * residual.H;
  const Eigen::Matrix3d R_VW = X_VW.rotation();
  out.H.leftCols<3>() = H_VT.leftCols<3>() * R_VW;
  out.H.rightCols<3>() = H_VT.rightCols<3>() * R_VW - out.H.leftCols<3>() * skew(X_WT.p);
  if (!lens.offset.is_none()) {
    // The prediction is `zoom` times as far from the centre as with the configured lens.
    out.y *= zoom;
    for (int i = 0; i < 4; ++i)
      out.y.segment<2>(2 * i) -=
          lens.offset.focal * (seen.raw_px[static_cast<std::size_t>(i)] - centre) +
          lens.offset.centre_px;
  }
  const Vector8d on_shift = -out.H * at.on_time;
  const Eigen::Vector2d moved_centre = centre + lens.offset.centre_px;
  for (int i = 0; i < 4; ++i) {
    const auto k = static_cast<std::size_t>(i);
    out.H_camera.col(0).segment<2>(2 * i) = seen.rows[k] * on_shift.segment<2>(2 * i);
    out.H_camera.col(1).segment<2>(2 * i) =
        (seen.raw_px[k] - out.y.segment<2>(2 * i) - moved_centre) / zoom;
    out.H_camera.block<2, 2>(2 * i, 2).setIdentity();
  }
  out.H_camera.col(4) = zoom * residual.H_k1;
  return out;
}

namespace {
void add_pose(TagMeasurement& m, int at, const Matrix86d& H) {
  m.add(at, H.leftCols<3>());
  m.add(at + 3, H.rightCols<3>());
}

/// Corner error by unmodelled effects of the lens, 1-sigma: second order of an uncertain focal
/// length (with the depths), and the second distortion coefficient when the first one is wrong.
double beyond_model_px(const FilterState& state, int camera, const CameraModel& model,
                       const TagObservation& seen) {
  constexpr double kSettledFocal = 1e-3;
  constexpr double kSettledDistortion = 1e-3;
  constexpr double kSecondCoefficient = 1.5;  // relative to the square of the first one
  const double variance = state.P()(layout::focal(camera), layout::focal(camera));
  const double k1 = state.lenses[static_cast<std::size_t>(camera)].k1;
  const bool is_settled = variance < kSettledFocal * kSettledFocal;
  if (is_settled && std::abs(k1) < kSettledDistortion) return 0;
  double radius_px = 0;
  for (const Eigen::Vector2d& px : seen.raw_px)
    radius_px += 0.25 * (px - Eigen::Vector2d(model.cu, model.cv)).norm();
  const double radius = radius_px / model.fu;
  const double bend = kSecondCoefficient * k1 * k1 * std::pow(radius, 4);
  return radius_px * std::hypot(is_settled ? 0.0 : variance, bend);
}

void add_sizes(const FilterState& state, const TagCorners& corners, const TagToUse& tag,
               Eigen::Index first, Eigen::Index rows, TagMeasurement& m) {
  const auto add = [&](int column) {
    const int in_block = (column - layout::sizes(state.cameras())) % 3;
    Matrix83d H = Matrix83d::Zero();
    H.col(in_block).segment(first, rows) = corners.H_size.segment(first, rows);
    m.add(column - in_block, H);
  };
  add(layout::sizes(state.cameras()));
  const int own = state.print_at(tag.seen->tag_id);
  if (own >= 0) add(own);
}

/// Fills some rows of the measurement, from `first`, for the camera at their exposure.
void compare(const FilterState& state, int camera, const CameraAt& at, const TagCorners& corners,
             const TagToUse& tag, Eigen::Index first, Eigen::Index rows, TagMeasurement& m) {
  m.in_front = m.in_front && corners.in_front;
  m.y.segment(first, rows) = corners.y.segment(first, rows);
  Matrix86d H = Matrix86d::Zero();
  H.middleRows(first, rows) = corners.H.middleRows(first, rows);
  m.H.middleRows(first, rows) = H.middleRows(first, rows);
  if (tag.local >= 0) add_pose(m, state.tag_at(static_cast<std::size_t>(tag.local)), H);
  add_pose(m, layout::camera(camera), at.moved() ? Matrix86d(-H * at.on_camera) : Matrix86d(-H));
  if (at.moved()) {
    add_pose(m, layout::kPosition, -H * at.on_body);
    m.add(layout::kVelocity, -H * at.on_velocity);
    m.add(layout::kBiasW, -H * at.on_gyro_bias);
  }
  if (!state.clock_is_open(camera) && !state.has_tested_parameters()) return;
  Matrix83d clock = Matrix83d::Zero();
  clock.col(0) = -H * at.on_time;
  CameraParameterMatrix parameters = CameraParameterMatrix::Zero();
  parameters.middleRows(first, rows) = corners.H_camera.middleRows(first, rows);
  clock.col(1) = parameters.col(0);
  if (state.has_tested_parameters()) {
    clock.col(2) = parameters.col(1);
    m.add(layout::centre(camera), parameters.rightCols<3>());
    add_sizes(state, corners, tag, first, rows, m);
  }
  m.add(layout::clock(camera), clock);
}

EstimatedLens lens_of(const FilterState& state, int camera, const CameraModel& model) {
  return {model, state.lenses[static_cast<std::size_t>(camera)]};
}
}  // namespace

const Pose& place_of(const FilterState& state, const TagToUse& tag) {
  return tag.local >= 0 ? state.tags[static_cast<std::size_t>(tag.local)].X_WT : tag.known->X_WT;
}

TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model,
                       const TagToUse& tag, const CornerNoise& noise) {
  TagMeasurement m;
  m.tag_id = tag.seen->tag_id;
  const double beyond_px = beyond_model_px(state, camera, model, *tag.seen);
  m.noise_px = std::hypot(noise.of(*tag.seen), beyond_px);
  m.even = !noise.is_uneven(*tag.seen);
  m.R = !m.even ? noise.covariance(*tag.seen, beyond_px)
                : Matrix8d(Matrix8d::Identity() * m.noise_px * m.noise_px);
  const CameraClock& clock = state.clocks[static_cast<std::size_t>(camera)];
  const auto compare_at = [&](double row, Eigen::Index first, Eigen::Index rows) {
    const CameraAt at = camera_at(state, camera, clock.seconds_to(row));
    compare(state, camera, at,
            corners_of(at, lens_of(state, camera, model), *tag.seen, place_of(state, tag),
                       state.sizes.factor(m.tag_id)),
            tag, first, rows, m);
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
  const CameraClock& clock = state.clocks[static_cast<std::size_t>(camera)];
  const CameraAt at = camera_at(state, camera, clock.seconds_to(0));
  out.shared = clock.rows_apart ? SharedPose{} : error_of(at, camera);
  out.shared.noise = clock.jitter_s * clock.jitter_s * at.on_time * at.on_time.transpose();
  out.tags.resize(tags.size());
  out.parameters = {};
  if (clock.rows_apart) {
    for (std::size_t i = 0; i < tags.size(); ++i)
      out.tags[i] = measure(state, camera, model, tags[i], noise);
    return;
  }
  if (state.has_tested_parameters())
    out.parameters = {layout::readout(camera), layout::sizes(state.cameras())};
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const TagToUse& tag = tags[i];
    TagMeasurement& m = out.tags[i];
    m.tag_id = tag.seen->tag_id;
    const TagCorners corners = corners_of(at, lens_of(state, camera, model), *tag.seen,
                                          place_of(state, tag), state.sizes.factor(m.tag_id));
    m.y = corners.y;
    m.in_front = corners.in_front;
    m.relative = true;
    m.own =
        tag.local >= 0 ? state.tag_at(static_cast<std::size_t>(tag.local)) : TagMeasurement::kGiven;
    m.H = corners.H;
    const double beyond_px = beyond_model_px(state, camera, model, *tag.seen);
    m.noise_px = std::hypot(noise.of(*tag.seen), beyond_px);
    m.even = !noise.is_uneven(*tag.seen);
    if (!m.even) m.R = noise.covariance(*tag.seen, beyond_px);
    m.block_count = 0;
    if (!out.parameters.are_there()) continue;
    m.H_camera = corners.H_camera;
    m.H_size = corners.H_size;
    m.own_size = state.print_at(m.tag_id);
    m.y -= clock.readout_s * m.H_camera.col(0);
  }
}

}  // namespace fiducap::world
