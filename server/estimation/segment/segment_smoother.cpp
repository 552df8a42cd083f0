#include "estimation/segment/segment_smoother.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "estimation/filter/filter_rules.hpp"
#include "estimation/world/corner_measurement.hpp"
#include "estimation/world/propagation.hpp"

namespace fiducap {
namespace {
using Matrix15d = Eigen::Matrix<double, 15, 15>;

// Gauss–Newton over the path: ends at a step of a pose below all published digits, m and rad. It
// converges quadratically, with outliers linearly by their weights.
constexpr double kSettled = 1e-6;
constexpr int kMostPasses = 8;
// Smallest sigma of the motion between two images, m, rad and m/s: in a single step position and
// velocity are fully correlated, and a singular covariance causes rounding errors.
constexpr double kSurestMotion = 1e-6;
// Sigma of an unused bias, m/s² and rad/s.
constexpr double kUnusedBias = 1e-9;

/// ½ zᵀ Λ z − ηᵀ z + cost, z = (the body now, the rest: [begin, end, cameras, tags, gravity]).
struct Information {
  explicit Information(int rest)
      : H(Eigen::MatrixXd::Zero(15 + rest, 15 + rest)), pull(Eigen::VectorXd::Zero(15 + rest)) {}

  [[nodiscard]] Eigen::Index rest() const { return H.rows() - 15; }
  auto own() { return H.topLeftCorner<15, 15>(); }
  /// The rest by the body now.
  auto below() { return H.bottomLeftCorner(rest(), 15); }
  auto all() { return H.bottomRightCorner(rest(), rest()); }

  /// The body now is that at `at` of the rest.
  void bind(Eigen::Index at) {
    const Eigen::Index after = rest() - at - 15;
    all().block<15, 15>(at, at) += own();
    all().bottomRows(after).middleCols<15>(at) += below().bottomRows(after);
    all().middleRows<15>(at).leftCols(at) += below().topRows(at).transpose();
    pull.segment<15>(15 + at) += pull.head<15>();
  }

  Eigen::MatrixXd H;  ///< Lower triangle.
  Eigen::VectorXd pull;
  double cost{0};
};

/// Back substitution of an eliminated instance.
struct Eliminated {
  Eigen::LLT<Matrix15d> own;
  Matrix15d on_next;
  Eigen::MatrixXd on_rest;
  Vector15d pull;
};

/// Linear motion between two instances: ξ₊ = Φ ξ + G δ + r + w, with δ of gravity.
struct Motion {
  Matrix15d Phi;
  Matrix15d W;  ///< Q⁻¹
  Vector15d r;
  Vector15d by_gravity;
};

/// Corners of one tag: columns by the body, then y, then by the errors of stamp, camera and tag.
struct Rows {
  static constexpr int kY = 15;
  static constexpr int kTime = 16;
  static constexpr int kCamera = 17;
  static constexpr int kTag = kCamera + segment_layout::kCameraSize;
  static constexpr int kAll = kTag + segment_layout::kTagSize;
  using Matrix = Eigen::Matrix<double, 8, kAll>;

  void take(const world::CameraAt& at, const Pose& X_BV, const world::TagCorners& m,
            Eigen::Index first, Eigen::Index count) {
    using namespace world::layout;  // NOLINT: block names
    in_front = in_front && m.in_front;
    const Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 8, 6> H = m.H.middleRows(first, count);
    auto out = J.middleRows(first, count);
    out.leftCols<6>() = -H;
    if (at.moved()) {
      out.middleCols<3>(kVelocity) = -H * at.on_velocity;
      out.middleCols<3>(kBiasW) = -H * at.on_gyro_bias;
    }
    out.col(kY) = m.y.segment(first, count);
    out.col(kTime) = -H * at.on_time;
    // The error of X_WV is the body's plus Ad(X_WB) times that of X_BV.
    out.middleCols<6>(kCamera) = -H * world::adjoint(at.X_WV * X_BV.inverse());
    out.col(kCamera + segment_layout::kClock) = out.col(kTime);
    out.middleCols<5>(kCamera + segment_layout::kReadout) = m.H_camera.middleRows(first, count);
    out.middleCols<6>(kTag) = H;
    out.col(kTag + 6) = m.H_size.segment(first, count);
  }

  Matrix J{Matrix::Zero()};
  bool in_front{true};
};

/// Error of an image's stamp, shared by its tags.
struct StampError {
  Eigen::VectorXd on_all;  ///< Information with (the body now, the rest).
  double own{0};
  double pull{0};
};

/// Least squares problem of one segment, with the body's path between its ends eliminated instance
/// by instance. Linearised at the segment's present values; errors on the world's side about the
/// origin of its axes. Keeps a reference to the segment, which has its origin at its begin
/// meanwhile: a near one is numerically better.
class SegmentElimination final {
 public:
  explicit SegmentElimination(MotionSegment& segment)
      : segment_(segment),
        cameras_(static_cast<int>(segment.cameras.size())),
        rest_(segment_layout::gravity(cameras_, static_cast<int>(segment.tags.size())) +
              (segment.has_imu() ? 1 : 0)),
        gravity_W_(0, 0, -segment.sensors->gravity_m_s2),
        origin_(segment.begin().X_WB.p) {
    segment_.scales.resize(segment_.tags.size());
    shift(-origin_);
  }
  ~SegmentElimination() { shift(origin_); }
  SegmentElimination(const SegmentElimination&) = delete;
  SegmentElimination& operator=(const SegmentElimination&) = delete;

  /// Moves the path to its solution.
  /// @return over the rest; nullopt: not finite, or images show no tag
  std::optional<Information> smooth() {
    for (int pass = 0; pass < kMostPasses; ++pass) {
      (void)run(false);
      if (move_inner() < kSettled) break;
    }
    Information info = run(true);
    if (sightings_ == 0 && (images_ > 0 || !segment_.tags.empty())) return std::nullopt;
    if (!info.H.allFinite() || !std::isfinite(info.cost)) return std::nullopt;
    return info;
  }

  /// Of the inner instances, in their order.
  [[nodiscard]] const std::vector<Eliminated>& eliminated() const { return eliminated_; }
  [[nodiscard]] int sightings() const { return sightings_; }
  [[nodiscard]] int outliers() const { return outliers_; }

 private:
  void shift(const Eigen::Vector3d& by) {
    for (MotionSegment::Instance& instance : segment_.instances) instance.body.X_WB.p += by;
    for (KnownTag& tag : segment_.tags) tag.X_WT.p += by;
  }

  /// @param has_rest  false: the rest is fixed, for move_inner() alone
  Information run(bool has_rest) {
    Information info(has_rest ? rest_ : 0);
    eliminated_.clear();
    images_ = sightings_ = outliers_ = 0;
    const std::size_t last = segment_.instances.size() - 1;
    for (std::size_t k = 0; k <= last; ++k) {
      const bool is_inner = k > 0 && k < last;
      if (k == 1) begin(move(k), info);
      if (k > 1) eliminate(move(k), info);
      if (has_rest || is_inner) add_images(k, info);
      if (has_rest && !is_inner) info.bind(k == 0 ? segment_layout::kBegin : segment_layout::kEnd);
    }
    return info;
  }

  /// After run(): moves the inner instances to their solution.
  /// @return the largest step of a pose
  double move_inner() {
    double largest = 0;
    Vector15d next = Vector15d::Zero();
    for (std::size_t k = eliminated_.size(); k-- > 0;) {
      next = eliminated_[k].own.solve(eliminated_[k].pull - eliminated_[k].on_next * next).eval();
      if (!next.allFinite()) return 0;
      BodyMoment& body = segment_.instances[k + 1].body;
      largest = std::max(largest, next.head<6>().cwiseAbs().maxCoeff());
      body = moved(body, next);
    }
    return largest;
  }

  [[nodiscard]] world::MovingBody moving(const BodyMoment& body) const {
    return {.time = body.at,
            .X_WB = body.X_WB,
            .v_WB = body.v_WB,
            .bias_f = body.bias_f,
            .bias_w = body.bias_w,
            .gravity_offset_m_s2 = segment_.gravity_offset_m_s2,
            .imu = segment_.imu};
  }

  /// From the instance before.
  [[nodiscard]] Motion move(std::size_t k) const {
    const MotionSegment::Instance& to = segment_.instances[k];
    world::MovingBody body = moving(segment_.instances[k - 1].body);
    world::MotionSinceImage motion;
    for (const SegmentStep& step : to.steps)
      world::propagate(body, motion, step.input, gravity_W_, step.dt_s);
    Motion out{motion.Phi, {}, {}, Vector15d::Zero()};
    out.by_gravity.head<world::layout::kBiasF>() = motion.by_parameters.col(0);
    motion.Q.diagonal().head<9>().array() += kSurestMotion * kSurestMotion;
    motion.Q.diagonal().tail<6>().array() += kUnusedBias * kUnusedBias;
    out.W = motion.Q.llt().solve(Matrix15d::Identity());
    out.W = (0.5 * (out.W + out.W.transpose())).eval();
    out.r = error_between(to.body, {to.body.at, body.X_WB, body.v_WB, body.bias_f, body.bias_w});
    return out;
  }

  /// The motion from the begin, which is part of the rest.
  void begin(const Motion& m, Information& info) const {
    if (info.rest() == 0) return start_body(m, info);
    const Matrix15d WPhi = m.W * m.Phi;
    info.all().block<15, 15>(0, 0) += m.Phi.transpose() * WPhi;
    info.pull.segment<15>(15) -= WPhi.transpose() * m.r;
    if (segment_.has_imu())
      info.all().bottomRows<1>().leftCols<15>() += m.by_gravity.transpose() * WPhi;
    info.below().setZero();
    start_body(m, info);
    info.below().topRows<15>() = -WPhi.transpose();
    add_gravity(m, info);
  }

  static void start_body(const Motion& m, Information& info) {
    info.own() = m.W;
    info.pull.head<15>() = m.W * m.r;
    info.cost += 0.5 * m.r.dot(m.W * m.r);
  }

  void eliminate(const Motion& m, Information& info) {
    const Matrix15d WPhi = m.W * m.Phi;
    Eliminated e;
    e.own.compute(info.own() + m.Phi.transpose() * WPhi);
    e.on_next = -WPhi.transpose();
    e.on_rest = info.below().transpose();
    if (segment_.has_imu() && info.rest() > 0)
      e.on_rest.rightCols<1>() += WPhi.transpose() * m.by_gravity;
    e.pull = info.pull.head<15>() - WPhi.transpose() * m.r;
    const Matrix15d by_next = e.own.matrixL().solve(e.on_next);
    const Vector15d by_pull = e.own.matrixL().solve(e.pull);
    start_body(m, info);
    info.cost -= 0.5 * by_pull.squaredNorm();
    info.own().noalias() -= by_next.transpose() * by_next;
    info.pull.head<15>().noalias() -= by_next.transpose() * by_pull;
    if (info.rest() > 0) {
      const Eigen::MatrixXd by_rest = e.own.matrixL().solve(e.on_rest);
      info.below().noalias() = -(by_rest.transpose() * by_next);
      info.all().selfadjointView<Eigen::Lower>().rankUpdate(by_rest.transpose(), -1.0);
      info.pull.tail(info.rest()).noalias() -= by_rest.transpose() * by_pull;
      add_gravity(m, info);
    }
    eliminated_.push_back(std::move(e));
  }

  /// Adds the information of the motion about gravity, the last of the rest.
  void add_gravity(const Motion& m, Information& info) const {
    if (!segment_.has_imu()) return;
    const Vector15d WG = m.W * m.by_gravity;
    info.H.bottomLeftCorner<1, 15>() -= WG.transpose();
    info.H.bottomRightCorner<1, 1>()(0, 0) += WG.dot(m.by_gravity);
    info.pull.tail<1>()(0) -= WG.dot(m.r);
  }

  /// The motion while the shutter is open is that of the last step, for the first instance the
  /// next.
  void add_images(std::size_t k, Information& info) {
    const MotionSegment::Instance& instance = segment_.instances[k];
    const bool is_first = k == 0;
    const auto& steps = segment_.instances[is_first ? 1 : k].steps;
    world::MovingBody body = moving(instance.body);
    if (!steps.empty()) {
      const InertialInput& input = (is_first ? steps.front() : steps.back()).input;
      body.gyro_B = body.imu.rate(input.w_B - body.bias_w) + body.bias_w;
      if (input.has_accelerometer)
        body.a_WB = body.X_WB.q * body.imu.force(input.f_B - body.bias_f) + gravity_W_;
    }
    for (const SegmentImage& image : instance.images) {
      ++images_;
      StampError stamp{Eigen::VectorXd::Zero(info.H.rows())};
      for (const SegmentSighting& sighting : image.tags) add(body, image, sighting, stamp, info);
      if (image.jitter_s <= 0) continue;
      const double own = stamp.own + 1.0 / (image.jitter_s * image.jitter_s);
      info.H.selfadjointView<Eigen::Lower>().rankUpdate(stamp.on_all, -1.0 / own);
      info.pull -= stamp.on_all * (stamp.pull / own);
      info.cost -= 0.5 * stamp.pull * stamp.pull / own;
    }
  }

  void add(const world::MovingBody& body, const SegmentImage& image,
           const SegmentSighting& sighting, StampError& stamp, Information& info) {
    const auto found = std::ranges::find(segment_.tags, sighting.seen.tag_id, &KnownTag::tag_id);
    if (found == segment_.tags.end()) return;
    const int tag = static_cast<int>(found - segment_.tags.begin());
    const Rows rows = rows_of(body, image, sighting.seen, static_cast<std::size_t>(tag));
    if (!rows.in_front || !rows.J.col(Rows::kY).allFinite()) return;
    const int columns = info.rest() > 0 ? Rows::kAll : Rows::kCamera;
    Rows::Matrix WJ = rows.J / (sighting.noise_px * sighting.noise_px);
    if (!sighting.is_even) WJ = sighting.covariance.llt().solve(rows.J);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, Rows::kAll, Rows::kAll> N =
        rows.J.leftCols(columns).transpose() * WJ.leftCols(columns);
    const double distance = N(Rows::kY, Rows::kY);
    const double trust = 1.0 / (1.0 + distance / filter_rules::kLossBend);
    N *= trust;
    ++sightings_;
    if (trust < 0.5) ++outliers_;
    // Cost of the Cauchy loss, not of the weighted square.
    info.cost += 0.5 * filter_rules::kLossBend * std::log1p(distance / filter_rules::kLossBend);
    stamp.own += N(Rows::kTime, Rows::kTime);
    stamp.pull += N(Rows::kTime, Rows::kY);

    // In the rows, size, in the information.
    const std::array<std::array<int, 3>, 3> parts{
        {{0, 15, 0},
         {Rows::kCamera, segment_layout::kCameraSize, 15 + segment_layout::camera(image.camera)},
         {Rows::kTag, segment_layout::kTagSize, 15 + segment_layout::tag(cameras_, tag)}}};
    for (const auto& [from, size, to] : parts) {
      if (from >= columns) return;
      info.pull.segment(to, size) += N.col(Rows::kY).segment(from, size);
      stamp.on_all.segment(to, size) += N.col(Rows::kTime).segment(from, size);
      for (const auto& [before, width, at] : parts)
        if (before <= from) info.H.block(to, at, size, width) += N.block(from, before, size, width);
    }
  }

  [[nodiscard]] Rows rows_of(const world::MovingBody& body, const SegmentImage& image,
                             const TagObservation& seen, std::size_t tag) const {
    const auto c = static_cast<std::size_t>(image.camera);
    const CameraBelief& camera = segment_.cameras[c];
    const world::CameraClock clock{
        .shift_s = camera.shift_s, .readout_s = camera.readout_s, .applied_s = image.applied_s};
    Rows out;
    const auto take = [&](double row, Eigen::Index first, Eigen::Index count) {
      const world::CameraAt at = world::camera_at(body, camera.X_BV, clock.seconds_to(row));
      const world::TagCorners corners =
          world::corners_of(at, {segment_.sensors->cameras[c].model, camera.lens}, seen,
                            segment_.tags[tag].X_WT, 1 + segment_.scales[tag]);
      out.take(at, camera.X_BV, corners, first, count);
    };
    if (camera.readout_s == 0) {
      take(0, 0, 8);
    } else {
      for (Eigen::Index i = 0; i < 4; ++i) take(seen.rows[static_cast<std::size_t>(i)], 2 * i, 2);
    }
    return out;
  }

  MotionSegment& segment_;
  int cameras_;
  int rest_;
  Eigen::Vector3d gravity_W_;
  std::vector<Eliminated> eliminated_;
  Eigen::Vector3d origin_;
  int images_{0};
  int sightings_{0};
  int outliers_{0};
};

}  // namespace

std::optional<SegmentFactor> condense(MotionSegment& segment) {
  if (segment.instances.size() < 2) return std::nullopt;
  SegmentElimination elimination(segment);
  auto info = elimination.smooth();
  if (!info) return std::nullopt;
  return SegmentFactor{.begin = segment.begin(),
                       .end = segment.end(),
                       .cameras = segment.cameras,
                       .tags = segment.tags,
                       .scales = segment.scales,
                       .gravity_offset_m_s2 = segment.gravity_offset_m_s2,
                       .H = info->all().selfadjointView<Eigen::Lower>(),
                       .g = -info->pull.tail(info->rest()),
                       .cost = info->cost,
                       .numbers = 8 * elimination.sightings(),
                       .sightings = elimination.sightings(),
                       .outliers = elimination.outliers()};
}

std::vector<PathPoint> path_between(MotionSegment& segment) {
  if (segment.instances.size() < 2) return {};
  SegmentElimination elimination(segment);
  const auto info = elimination.smooth();
  if (!info) return {};
  const auto& between = elimination.eliminated();
  std::vector<PathPoint> path(between.size());
  // The end is part of the rest.
  PathPoint next{Matrix15d::Zero(), Eigen::MatrixXd::Zero(15, info->rest())};
  next.by_rest.middleCols<15>(segment_layout::kEnd).setIdentity();
  for (std::size_t k = between.size(); k-- > 0;) {
    const Eliminated& here = between[k];
    const Matrix15d on_next = -here.own.solve(here.on_next);
    path[k].given = here.own.solve(Matrix15d::Identity());
    path[k].given += on_next * next.given * on_next.transpose();
    path[k].by_rest = on_next * next.by_rest - here.own.solve(here.on_rest);
    next = path[k];
  }
  return path;
}

}  // namespace fiducap
