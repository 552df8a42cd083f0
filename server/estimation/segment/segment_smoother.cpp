#include "estimation/segment/segment_smoother.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "estimation/filter/filter_rules.hpp"
#include "estimation/segment/normal_equations.hpp"
#include "estimation/world/corner_measurement.hpp"
#include "estimation/world/propagation.hpp"

namespace fiducap {
namespace {
using Matrix15d = Eigen::Matrix<double, 15, 15>;

// Gauss–Newton over the path: ends at a step of a pose after which the next one is below all
// published digits, m and rad. It converges quadratically, with outliers linearly by their weights.
constexpr double kSettled = 1e-4;
constexpr int kMostPasses = 8;
// Smallest sigma of the motion between two images, m, rad and m/s: in a single step position and
// velocity are fully correlated, and a singular covariance causes rounding errors.
constexpr double kSurestMotion = 1e-6;
// Sigma of an unused bias, m/s² and rad/s.
constexpr double kUnusedBias = 1e-9;
// Sigma of an exact stamp: at 10 m/s a micrometre.
constexpr double kExactStamp_s = 1e-7;

/// Corners of one tag: y, and columns by the errors of body, stamp, camera and tag.
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

/// Least squares problem of one segment: variables are the path (inner instances and the errors of
/// all images' stamps) and, in the order of segment_layout, the rest. Linearised at the segment's
/// present values; errors on the world's side about the origin of its axes. Keeps a reference to
/// the segment, which has its origin at its begin meanwhile: a near one is numerically better.
class SegmentProblem final {
 public:
  explicit SegmentProblem(MotionSegment& segment)
      : segment_(segment),
        last_(segment.instances.size() - 1),
        gravity_W_(0, 0, -segment.sensors->gravity_m_s2),
        origin_(segment.begin().X_WB.p) {
    segment_.scales.resize(segment_.tags.size());
    sizes_.assign(last_ - 1, 15);
    for (const MotionSegment::Instance& instance : segment_.instances)
      sizes_.insert(sizes_.end(), instance.images.size(), 1);
    path_ = static_cast<int>(sizes_.size());
    sizes_.insert(sizes_.end(), {15, 15});
    sizes_.insert(sizes_.end(), segment_.cameras.size(), segment_layout::kCameraSize);
    sizes_.insert(sizes_.end(), segment_.tags.size(), segment_layout::kTagSize);
    if (segment_.has_imu()) sizes_.push_back(1);
    shift(-origin_);
  }
  ~SegmentProblem() { shift(origin_); }
  SegmentProblem(const SegmentProblem&) = delete;
  SegmentProblem& operator=(const SegmentProblem&) = delete;

  /// Moves the path to its solution.
  /// @return the path eliminated; nullopt: not finite, or images show no tag
  std::optional<Reduced> solve() {
    for (int pass = 0; pass < kMostPasses && last_ > 1; ++pass)
      if (move_path() < kSettled) break;
    auto reduced = reduce(linearised(true), path_);
    if (sightings_ == 0 && (images_ > 0 || !segment_.tags.empty())) return std::nullopt;
    return reduced;
  }

  [[nodiscard]] int inner() const { return static_cast<int>(last_) - 1; }
  [[nodiscard]] int sightings() const { return sightings_; }
  [[nodiscard]] int outliers() const { return outliers_; }

 private:
  void shift(const Eigen::Vector3d& by) {
    for (MotionSegment::Instance& instance : segment_.instances) instance.body.X_WB.p += by;
    for (KnownTag& tag : segment_.tags) tag.X_WT.p += by;
  }

  // Variables.
  [[nodiscard]] int body(std::size_t k) const {
    return k == 0 ? path_ : k == last_ ? path_ + 1 : static_cast<int>(k) - 1;
  }
  [[nodiscard]] int camera(int c) const { return path_ + 2 + c; }
  [[nodiscard]] int tag(int i) const {
    return camera(static_cast<int>(segment_.cameras.size())) + i;
  }
  [[nodiscard]] int gravity() const { return tag(static_cast<int>(segment_.tags.size())); }

  /// @param has_rest  false: it is fixed
  NormalEquations linearised(bool has_rest) {
    NormalEquations out(has_rest ? sizes_
                                 : std::vector<int>(sizes_.begin(), sizes_.begin() + path_));
    images_ = sightings_ = outliers_ = 0;
    for (std::size_t k = 0; k <= last_; ++k) {
      if (k > 0) add_motion(k, out);
      add_images(k, out);
    }
    return out;
  }

  /// One step of Gauss–Newton with a fixed rest.
  /// @return the largest one of a pose
  double move_path() {
    const NormalEquations equations = linearised(false);
    const auto factor = BlockCholesky::factor(equations.H);
    if (!factor) return 0;
    const Eigen::VectorXd step = factor->solve(equations.pull);
    if (!step.allFinite()) return 0;
    double largest = 0;
    for (std::size_t k = 1; k < last_; ++k) {
      const Vector15d own = step.segment<15>(equations.H.first(body(k)));
      largest = std::max(largest, own.head<6>().cwiseAbs().maxCoeff());
      segment_.instances[k].body = moved(segment_.instances[k].body, own);
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

  /// From the instance before, linear: ξ_k = Φ ξ + G δ + r + w, with δ of gravity and noise w.
  void add_motion(std::size_t k, NormalEquations& out) const {
    const MotionSegment::Instance& to = segment_.instances[k];
    world::MovingBody reached = moving(segment_.instances[k - 1].body);
    world::MotionSinceImage motion;
    for (const SegmentStep& step : to.steps)
      world::propagate(reached, motion, step.input, gravity_W_, step.dt_s);
    motion.Q.diagonal().head<9>().array() += kSurestMotion * kSurestMotion;
    motion.Q.diagonal().tail<6>().array() += kUnusedBias * kUnusedBias;
    const Matrix15d W = motion.Q.llt().solve(Matrix15d::Identity());
    const Vector15d r = error_between(
        to.body, {to.body.at, reached.X_WB, reached.v_WB, reached.bias_f, reached.bias_w});
    Vector15d G = Vector15d::Zero();
    G.head<world::layout::kBiasF>() = motion.by_parameters.col(0);
    std::vector<TermPart> parts{{body(k), 0, Matrix15d::Identity()}, {body(k - 1), 0, -motion.Phi}};
    if (segment_.has_imu()) parts.push_back({gravity(), 0, -G});
    std::erase_if(parts, [&](const TermPart& a) { return a.variable >= out.H.variables(); });
    out.add_square(parts, 0.5 * (W + W.transpose()), -r);
  }

  /// The motion while the shutter is open is that of the last step, for the first instance the
  /// next.
  void add_images(std::size_t k, NormalEquations& out) {
    const MotionSegment::Instance& instance = segment_.instances[k];
    const auto& steps = segment_.instances[std::max<std::size_t>(k, 1)].steps;
    world::MovingBody moving_body = moving(instance.body);
    if (!steps.empty()) {
      const InertialInput& input = (k == 0 ? steps.front() : steps.back()).input;
      moving_body.gyro_B =
          moving_body.imu.rate(input.w_B - moving_body.bias_w) + moving_body.bias_w;
      if (input.has_accelerometer)
        moving_body.a_WB =
            moving_body.X_WB.q * moving_body.imu.force(input.f_B - moving_body.bias_f) + gravity_W_;
    }
    for (const SegmentImage& image : instance.images) {
      const int stamp = static_cast<int>(last_) - 1 + images_++;
      const double jitter_s = std::max(image.jitter_s, kExactStamp_s);
      out.H.add(stamp, stamp, Eigen::MatrixXd::Constant(1, 1, 1 / (jitter_s * jitter_s)));
      if (body(k) >= out.H.variables()) continue;  // fixed
      const CameraBelief& camera = segment_.cameras[static_cast<std::size_t>(image.camera)];
      const world::CameraClock clock{
          .shift_s = camera.shift_s, .readout_s = camera.readout_s, .applied_s = image.applied_s};
      const auto camera_in = [&](double row) {
        return world::camera_at(moving_body, camera.X_BV, clock.seconds_to(row));
      };
      const world::CameraAt middle = camera_in(0);
      for (const SegmentSighting& sighting : image.tags)
        add(body(k), stamp, image, sighting, middle, camera_in, out);
    }
  }

  /// @param middle     the camera at the middle row
  /// @param camera_in  at another row
  template <class CameraIn>
  void add(int body, int stamp, const SegmentImage& image, const SegmentSighting& sighting,
           const world::CameraAt& middle, const CameraIn& camera_in, NormalEquations& out) {
    const auto found = std::ranges::find(segment_.tags, sighting.seen.tag_id, &KnownTag::tag_id);
    if (found == segment_.tags.end()) return;
    const auto number = static_cast<std::size_t>(found - segment_.tags.begin());
    const Rows rows = rows_of(image, sighting.seen, number, middle, camera_in);
    if (!rows.in_front || !rows.J.col(Rows::kY).allFinite()) return;
    Rows::Matrix WJ = rows.J / (sighting.noise_px * sighting.noise_px);
    if (!sighting.is_even) WJ = sighting.covariance.llt().solve(rows.J);
    const int columns = out.H.variables() > path_ ? Rows::kAll : Rows::kCamera;
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, Rows::kAll, Rows::kAll> N =
        rows.J.leftCols(columns).transpose() * WJ.leftCols(columns);
    const double bent = N(Rows::kY, Rows::kY) / filter_rules::kLossBend;
    N /= 1.0 + bent;
    ++sightings_;
    if (bent > 1) ++outliers_;
    // Cost of the Cauchy loss, not of the weighted square.
    out.cost += 0.5 * filter_rules::kLossBend * std::log1p(bent);
    struct Part {
      int from;  ///< Column of the rows.
      int size;
      int variable;
    };
    const std::array<Part, 4> parts{
        {{0, 15, body},
         {Rows::kTime, 1, stamp},
         {Rows::kCamera, segment_layout::kCameraSize, camera(image.camera)},
         {Rows::kTag, segment_layout::kTagSize, tag(static_cast<int>(number))}}};
    for (const Part& a : parts) {
      if (a.variable >= out.H.variables()) return;
      out.pull.segment(out.H.first(a.variable), a.size) += N.col(Rows::kY).segment(a.from, a.size);
      for (const Part& b : parts)
        if (b.from <= a.from)
          out.H.add(a.variable, b.variable, N.block(a.from, b.from, a.size, b.size));
    }
  }

  template <class CameraIn>
  [[nodiscard]] Rows rows_of(const SegmentImage& image, const TagObservation& seen, std::size_t tag,
                             const world::CameraAt& middle, const CameraIn& camera_in) const {
    const auto c = static_cast<std::size_t>(image.camera);
    const CameraBelief& camera = segment_.cameras[c];
    Rows out;
    const auto take = [&](const world::CameraAt& at, Eigen::Index first, Eigen::Index count) {
      const world::TagCorners corners =
          world::corners_of(at, {segment_.sensors->cameras[c].model, camera.lens}, seen,
                            segment_.tags[tag].X_WT, 1 + segment_.scales[tag]);
      out.take(at, camera.X_BV, corners, first, count);
    };
    if (camera.readout_s == 0) {
      take(middle, 0, 8);
    } else {
      for (Eigen::Index i = 0; i < 4; ++i)
        take(camera_in(seen.rows[static_cast<std::size_t>(i)]), 2 * i, 2);
    }
    return out;
  }

  MotionSegment& segment_;
  std::size_t last_;        ///< Instance.
  std::vector<int> sizes_;  ///< Of all variables …
  int path_{};              ///< … of which so many are the path.
  Eigen::Vector3d gravity_W_;
  Eigen::Vector3d origin_;
  int images_{0};
  int sightings_{0};
  int outliers_{0};
};

}  // namespace

std::optional<SegmentFactor> condense(MotionSegment& segment) {
  if (segment.instances.size() < 2) return std::nullopt;
  SegmentProblem problem(segment);
  auto reduced = problem.solve();
  if (!reduced) return std::nullopt;
  return SegmentFactor{.begin = segment.begin(),
                       .end = segment.end(),
                       .cameras = segment.cameras,
                       .tags = segment.tags,
                       .scales = segment.scales,
                       .gravity_offset_m_s2 = segment.gravity_offset_m_s2,
                       .H = std::move(reduced->H),
                       .g = -reduced->pull,
                       .cost = reduced->cost,
                       .numbers = 8 * problem.sightings(),
                       .sightings = problem.sightings(),
                       .outliers = problem.outliers()};
}

std::vector<PathPoint> path_between(MotionSegment& segment) {
  if (segment.instances.size() < 2) return {};
  SegmentProblem problem(segment);
  auto reduced = problem.solve();
  if (!reduced) return {};
  const Eigen::MatrixXd by_rest = -reduced->factor.solve(reduced->across.transpose());
  reduced->factor.invert();
  std::vector<PathPoint> path;
  for (int k = 0; k < problem.inner(); ++k)
    path.push_back({*reduced->factor.inverse(k, k), by_rest.middleRows<15>(15 * k)});
  return path;
}

}  // namespace fiducap
