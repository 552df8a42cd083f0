#include "estimation/segment/segment_elimination.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/world/propagation.hpp"

namespace fiducap {

namespace {
// Scale of the Cauchy loss, squared distance with 8 degrees of freedom.
constexpr double kLossBend = 8 * 5.0 * 5.0;
// Smallest sigma of the motion between two images, m, rad and m/s: in a single step position and
// velocity are fully correlated, and a singular covariance causes rounding errors.
constexpr double kSurestMotion = 1e-6;
// Sigma of an unused accelerometer bias.
constexpr double kUnusedBias = 1e-9;

std::span<const SegmentStep> last_of(std::span<const SegmentStep> steps) {
  return steps.last(std::min<std::size_t>(1, steps.size()));
}
}  // namespace

SegmentElimination::SegmentElimination(MotionSegment& segment)
    : segment_(segment),
      cameras_(static_cast<int>(segment.cameras.size())),
      rest_(segment_layout::gravity(cameras_, static_cast<int>(segment.tags.size())) +
            (segment.has_imu() ? 1 : 0)),
      noise_(EstimatorConfig{}, false) {
  segment_.scales.resize(segment_.tags.size());
  prepare_workspace();
}

void SegmentElimination::prepare_workspace() {
  std::vector<Pose> X_BV;
  for (const CameraBelief& camera : segment_.cameras) X_BV.push_back(camera.X_BV);
  workspace_.reset(std::move(X_BV));
  for (int c = 0; c < cameras_; ++c) {
    const CameraBelief& camera = segment_.cameras[static_cast<std::size_t>(c)];
    workspace_.clocks[static_cast<std::size_t>(c)] = {
        .shift_s = camera.shift_s, .readout_s = camera.readout_s, .rows_apart = camera.rows_apart};
    workspace_.lenses[static_cast<std::size_t>(c)] = camera.lens;
  }
  workspace_.gravity_offset_m_s2 = segment_.gravity_offset_m_s2;
  workspace_.imu = segment_.imu;
  workspace_.parameter_tests.resize(1);  // measure() includes the parameters
  for (const KnownTag& known : segment_.tags)
    workspace_.add_tag({{.tag_id = known.tag_id, .edge_m = known.edge_m}, known.X_WT},
                       Matrix6d::Zero());
}

void SegmentElimination::linearise_at(const MotionSegment::Instance& instance) {
  const BodyMoment& body = instance.body;
  workspace_.time = body.at;
  workspace_.X_WB = body.X_WB;
  workspace_.v_WB = body.v_WB;
  workspace_.bias_f = body.bias_f;
  workspace_.bias_w = body.bias_w;
}

SegmentElimination::Information SegmentElimination::run() {
  Information info(rest_);
  eliminated_.clear();
  sightings_ = outliers_ = 0;
  const auto& instances = segment_.instances;
  add_images(instances.front(), std::span(instances[1].steps), info);
  // The body now is the begin.
  info.all.block<15, 15>(0, 0) = info.own;
  info.all.middleRows<15>(0) += info.beside;
  info.all.middleCols<15>(0) += info.beside.transpose();
  info.pull.head<15>() += info.own_pull;
  for (std::size_t k = 1; k < instances.size(); ++k) {
    const Motion motion = move(instances[k - 1], instances[k]);
    k == 1 ? add_first_motion(motion, info) : add_motion(motion, info);
    add_images(instances[k], last_of(instances[k].steps), info);
  }
  // The body now is the end.
  info.all.block<15, 15>(15, 15) += info.own;
  info.all.middleRows<15>(15) += info.beside;
  info.all.middleCols<15>(15) += info.beside.transpose();
  info.pull.segment<15>(15) += info.own_pull;
  return info;
}

/// The images at the fixed ends do not affect the path.
void SegmentElimination::run_path() {
  Information info(0);
  eliminated_.clear();
  sightings_ = outliers_ = 0;
  const auto& instances = segment_.instances;
  for (std::size_t k = 1; k < instances.size(); ++k) {
    const Motion motion = move(instances[k - 1], instances[k]);
    k == 1 ? start_body(motion, info) : add_motion(motion, info);
    if (k + 1 == instances.size()) return;
    add_images(instances[k], last_of(instances[k].steps), info);
  }
}

SegmentElimination::Motion SegmentElimination::move(const MotionSegment::Instance& from,
                                                    const MotionSegment::Instance& to) {
  linearise_at(from);
  world::MotionSinceImage motion;
  const Eigen::Vector3d gravity(0, 0, -segment_.sensors->gravity_m_s2);
  for (const SegmentStep& step : to.steps)
    world::propagate(workspace_, motion, step.input, gravity, step.dt_s);
  Motion out;
  out.Phi = motion.Phi;
  out.by_gravity = Vector15d::Zero();
  out.by_gravity.head<world::layout::kBiasF>() = motion.by_parameters.col(0);
  Matrix15d Q = motion.Q;
  Q.diagonal().head<9>().array() += kSurestMotion * kSurestMotion;
  Q.diagonal().tail<6>().array() += kUnusedBias * kUnusedBias;
  out.W = Q.llt().solve(Matrix15d::Identity());
  out.W = (0.5 * (out.W + out.W.transpose())).eval();
  const BodyMoment predicted{to.body.at, workspace_.X_WB, workspace_.v_WB, workspace_.bias_f,
                             workspace_.bias_w};
  out.r = error_between(to.body, predicted);
  return out;
}

void SegmentElimination::add_first_motion(const Motion& m, Information& info) const {
  const Matrix15d WPhi = m.W * m.Phi;
  info.all.block<15, 15>(0, 0) += m.Phi.transpose() * WPhi;
  info.pull.head<15>() -= WPhi.transpose() * m.r;
  if (asks_for_gravity(info)) {
    const Vector15d WG = m.W * m.by_gravity;
    info.all.row(rest_ - 1).head<15>() += WG.transpose() * m.Phi;
    info.all.col(rest_ - 1).head<15>() += m.Phi.transpose() * WG;
  }
  start_body(m, info);
  info.beside.leftCols<15>() = -WPhi;
  info.beside.rightCols(rest_ - 15).setZero();
  add_gravity(m, info);
}

void SegmentElimination::start_body(const Motion& m, Information& info) {
  info.own = m.W;
  info.own_pull = m.W * m.r;
  info.cost += 0.5 * m.r.dot(m.W * m.r);
}

void SegmentElimination::add_motion(const Motion& m, Information& info) {
  const Matrix15d WPhi = m.W * m.Phi;
  Eliminated e;
  e.own.compute(info.own + m.Phi.transpose() * WPhi);
  e.on_next = -WPhi.transpose();
  e.on_rest = info.beside;
  if (asks_for_gravity(info)) e.on_rest.rightCols<1>() += WPhi.transpose() * m.by_gravity;
  e.pull = info.own_pull - WPhi.transpose() * m.r;
  const Matrix15d by_next = e.own.matrixL().solve(e.on_next);
  const Vector15d by_pull = e.own.matrixL().solve(e.pull);
  start_body(m, info);
  info.cost -= 0.5 * by_pull.squaredNorm();
  info.own.noalias() -= by_next.transpose() * by_next;
  info.own_pull.noalias() -= by_next.transpose() * by_pull;
  if (info.all.size() > 0) {
    const Eigen::MatrixXd by_rest = e.own.matrixL().solve(e.on_rest);
    info.beside.noalias() = -(by_next.transpose() * by_rest);
    info.all.selfadjointView<Eigen::Lower>().rankUpdate(by_rest.transpose(), -1.0);
    info.pull.noalias() -= by_rest.transpose() * by_pull;
    add_gravity(m, info);
  }
  eliminated_.push_back(std::move(e));
}

bool SegmentElimination::asks_for_gravity(const Information& info) const {
  return segment_.has_imu() && info.all.size() > 0;
}

/// Adds the information of the motion about gravity.
void SegmentElimination::add_gravity(const Motion& m, Information& info) const {
  if (!asks_for_gravity(info)) return;
  const Eigen::Index last = info.all.rows() - 1;
  const Vector15d WG = m.W * m.by_gravity;
  info.beside.rightCols<1>() -= WG;
  info.all(last, last) += WG.dot(m.by_gravity);
  info.pull(last) -= WG.dot(m.r);
}

void SegmentElimination::add_images(const MotionSegment::Instance& instance,
                                    std::span<const SegmentStep> motion, Information& info) {
  linearise_at(instance);
  // The present motion, for the derivative by the clock shift.
  workspace_.a_WB.setZero();
  workspace_.gyro_B.setZero();
  if (!motion.empty()) {
    const InertialInput& input = motion.front().input;
    workspace_.gyro_B = workspace_.imu.rate(input.w_B - workspace_.bias_w) + workspace_.bias_w;
    if (input.has_accelerometer)
      workspace_.a_WB = workspace_.X_WB.q * workspace_.imu.force(input.f_B - workspace_.bias_f) +
                        Eigen::Vector3d(0, 0, -segment_.sensors->gravity_m_s2);
  }
  for (const SegmentImage& image : instance.images) {
    const Eigen::Index rest = info.all.rows();
    ImageSum sum(static_cast<int>(rest) + 15);
    for (const SegmentSighting& sighting : image.tags) add(image, sighting, sum);
    take_jitter(image, sum);
    info.own += sum.H.topLeftCorner<15, 15>();
    info.beside += sum.H.topRightCorner(15, rest);
    info.all += sum.H.bottomRightCorner(rest, rest);
    info.own_pull += sum.pull.head<15>();
    info.pull += sum.pull.tail(rest);
    info.cost += sum.cost;
  }
}

void SegmentElimination::add(const SegmentImage& image, const SegmentSighting& sighting,
                             ImageSum& sum) {
  const int tag = workspace_.find(sighting.seen.tag_id);
  if (tag < 0) return;
  auto& clock = workspace_.clocks[static_cast<std::size_t>(image.camera)];
  clock.applied_s = image.applied_s;
  workspace_.sizes.common = segment_.scales[static_cast<std::size_t>(tag)];
  const TagMeasurement m =
      world::measure(workspace_, image.camera,
                     segment_.sensors->cameras[static_cast<std::size_t>(image.camera)].model,
                     {&sighting.seen, tag, nullptr}, noise_);
  if (!m.in_front || !m.y.allFinite()) return;
  Matrix8d weight = sighting.is_even
                        ? Matrix8d(Matrix8d::Identity() / (sighting.noise_px * sighting.noise_px))
                        : Matrix8d(sighting.covariance.llt().solve(Matrix8d::Identity()));
  const double distance = m.y.dot(weight * m.y);
  const double trust = 1.0 / (1.0 + distance / kLossBend);
  weight *= trust;
  ++sightings_;
  if (trust < 0.5) ++outliers_;

  Parts found;
  for (std::size_t b = 0; b < m.block_count; ++b) place(m.blocks[b], found);
  Vector8d on_time = Vector8d::Zero();
  Vector8d on_scale = Vector8d::Zero();
  for (std::size_t b = 0; b < m.block_count; ++b) {
    const auto first = m.blocks[b].H.col(0);
    if (m.blocks[b].at == world::layout::clock(image.camera)) on_time = first;
    if (m.blocks[b].at == world::layout::sizes(cameras_)) on_scale = first;
  }
  add_products(found, weight, m.y, on_time, sum);
  const int scale_at = 15 + segment_layout::scale(cameras_, tag);
  if (scale_at < sum.H.rows()) add_scale(found, weight, m.y, {scale_at, on_scale, on_time}, sum);
  // Cost of the Cauchy loss, not of the weighted square.
  sum.cost += 0.5 * kLossBend * std::log1p(distance / kLossBend);
}

/// Skips parameters that are not in the sum.
void SegmentElimination::add_products(const Parts& found, const Matrix8d& weight, const Vector8d& y,
                                      const Vector8d& on_time, ImageSum& sum) {
  const auto& [parts, count] = found;
  const Vector8d wy = weight * y;
  for (std::size_t a = 0; a < count; ++a) {
    if (parts[a].at >= sum.H.rows()) continue;
    const Matrix83d wH = weight * parts[a].H;
    sum.pull.segment<3>(parts[a].at) += parts[a].H.transpose() * wy;
    sum.by_time.segment<3>(parts[a].at) += wH.transpose() * on_time;
    sum.H.block<3, 3>(parts[a].at, parts[a].at) += parts[a].H.transpose() * wH;
    for (std::size_t b = 0; b < a; ++b) {
      if (parts[b].at >= sum.H.rows()) continue;
      const Eigen::Matrix3d product = parts[b].H.transpose() * wH;
      sum.H.block<3, 3>(parts[b].at, parts[a].at) += product;
      sum.H.block<3, 3>(parts[a].at, parts[b].at) += product.transpose();
    }
  }
  sum.time += on_time.dot(weight * on_time);
  sum.time_pull += on_time.dot(wy);
}

void SegmentElimination::add_scale(const Parts& found, const Matrix8d& weight, const Vector8d& y,
                                   const OfScale& scale, ImageSum& sum) {
  const Vector8d w_scale = weight * scale.H;
  for (std::size_t a = 0; a < found.count; ++a) {
    const Part& part = found.all[a];
    const Eigen::Vector3d with_scale = part.H.transpose() * w_scale;
    sum.H.block<3, 1>(part.at, scale.at) += with_scale;
    sum.H.block<1, 3>(scale.at, part.at) += with_scale.transpose();
  }
  sum.H(scale.at, scale.at) += scale.H.dot(w_scale);
  sum.pull(scale.at) += w_scale.dot(y);
  sum.by_time(scale.at) += w_scale.dot(scale.on_time);
}

/// Maps columns of the filter's state to those of the sum, except for tag sizes.
void SegmentElimination::place(const TagMeasurement::Block& block, Parts& out) const {
  auto& [parts, count] = out;
  namespace from = world::layout;
  if (block.at < from::kBodySize) {
    parts[count++] = {block.at, block.H};
    return;
  }
  if (block.at >= from::tag(cameras_, 0)) {
    const int at = block.at - from::tag(cameras_, 0);
    const int tag = at / from::kPoseSize;
    const int within = at % from::kPoseSize;
    parts[count++] = {15 + segment_layout::tag(cameras_, tag) + within, block.H};
    return;
  }
  if (block.at >= from::sizes(cameras_)) return;
  const int c = (block.at - from::kBodySize) / from::kCameraSize;
  const int within = block.at - from::camera(c);
  const int to = 15 + segment_layout::camera(c);
  if (within >= from::kPoseSize) {
    parts[count++] = {to + within, block.H};
    return;
  }
  // The error of X_WV is the body's plus Ad(X_WB) times that of X_BV.
  const Matrix6d Ad = world::adjoint(workspace_.X_WB);
  parts[count++] = {within, block.H};
  parts[count++] = {to, block.H * Ad.middleRows<3>(within).leftCols<3>()};
  parts[count++] = {to + 3, block.H * Ad.middleRows<3>(within).rightCols<3>()};
}

/// Eliminates the error of the image's stamp.
void SegmentElimination::take_jitter(const SegmentImage& image, ImageSum& sum) {
  if (image.jitter_s <= 0) return;
  const double own = sum.time + 1.0 / (image.jitter_s * image.jitter_s);
  sum.H.noalias() -= sum.by_time * sum.by_time.transpose() / own;
  sum.pull -= sum.by_time * (sum.time_pull / own);
  sum.cost -= 0.5 * sum.time_pull * sum.time_pull / own;
}

double SegmentElimination::move_inner() {
  double largest = 0;
  Vector15d next = Vector15d::Zero();
  for (std::size_t k = eliminated_.size(); k-- > 0;) {
    next = eliminated_[k].error(next);
    if (!next.allFinite()) return 0;
    BodyMoment& body = segment_.instances[k + 1].body;
    largest = std::max(largest, next.head<6>().cwiseAbs().maxCoeff());
    body = moved(body, next);
  }
  return largest;
}

}  // namespace fiducap
