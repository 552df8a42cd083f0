#include "daemon/setup/setup_rig.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/pose.hpp"
#include "base/text.hpp"

namespace fiducap {
namespace {

constexpr double kPi = std::numbers::pi;
// The "sheet" is a tag of the hall.
constexpr int kSheetTag = 0;
constexpr double kHold_s = 0.6;   // before each picture …
constexpr double kMove_s = 0.5;   // … and on to the next
constexpr double kStill_s = 1.5;  // before each wave …
constexpr double kRound_s = 32;   // … which lasts longer than required
constexpr double kDifference_s = 1e-3;
constexpr double kBorder = 1.15;  // of half a tag: least distance of its centre to the border

double fraction(double x) { return x - std::floor(x); }

/// 0 → 1 with speed and acceleration 0 at both ends.
double smooth(double x) { return x * x * x * (10 + x * (6 * x - 15)); }

/// The true camera, unknown to the set-up.
CameraMount true_camera() {
  CameraMount mount;
  mount.model = {752, 480, 458.6, 457.3, 367.2, 248.4, Distortion::kRadialTangential, {}};
  mount.model.coefficients = {-0.283, 0.074, 2.0e-4, 2.0e-5, 0};
  mount.X_BV = simulation::forward_camera();
  mount.X_BV.q = mount.X_BV.q * exp_so3({0.01, -0.006, 0.008});
  mount.X_BV.p = {0.106, 0.004, -0.017};
  mount.rate_hz = 20;
  return mount;
}

}  // namespace

/// The motion in each step.
class SimulatedRig::Motion final : public simulation::Trajectory {
 public:
  explicit Motion(std::shared_ptr<std::atomic<SetupStep>> step) : step_(std::move(step)) {
    for (const RecordedTag& tag : simulation::tags_of(SimulatedRig::room()))
      if (tag.tag_id == kSheetTag) X_WT_ = tag.X_WT;
  }

  [[nodiscard]] Point at(double t_s) const override {
    if (const SetupStep now = *step_; now != begun_) {
      begun_ = now;
      began_s_ = t_s;
    }
    const double t = t_s - began_s_;
    const double h = kDifference_s;
    const Pose before = pose(t - h), here = pose(t), after = pose(t + h);
    Point point;
    point.X_WB = here;
    point.v_WB = (after.p - before.p) / (2 * h);
    point.a_WB = (after.p - 2 * here.p + before.p) / (h * h);
    point.w_WB_B = log_so3(before.q.conjugate() * after.q) / (2 * h);
    return point;
  }

 private:
  [[nodiscard]] Pose pose(double t) const {
    switch (begun_) {
      case SetupStep::kPicture:
      case SetupStep::kLens:
        return looking_at_sheet(t);
      case SetupStep::kWave:
        return waved(t);
      default:
        return standing();
    }
  }

  /// In the hall, 2.5 m before the wall with the sheet.
  [[nodiscard]] static Pose standing() {
    return {Eigen::Quaterniond(Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitZ())),
            {0, 1.5, 1.6}};
  }

  /// Held still, then waved, repeatedly.
  [[nodiscard]] static Pose waved(double t) {
    const double in_round = kRound_s * fraction(t / kRound_s);
    const double strength = smooth(std::clamp(in_round - kStill_s, 0.0, 1.0)) *
                            smooth(std::clamp(kRound_s - in_round, 0.0, 1.0));
    const auto swing = [&](double size, double hz, double phase) {
      return strength * size * std::sin(2 * kPi * hz * t + phase);
    };
    const Pose middle = standing();
    return {middle.q * exp_so3({swing(0.4, 0.7, 0), swing(0.25, 0.9, 1), swing(0.25, 0.8, 2)}),
            middle.p + Eigen::Vector3d(swing(0.2, 0.85, 0.5), swing(0.2, 0.75, 1.5),
                                       swing(0.15, 0.95, 2.5))};
  }

  [[nodiscard]] Pose looking_at_sheet(double t) const {
    const double each = kHold_s + kMove_s;
    const double place = std::max(0.0, t) / each;
    const int k = static_cast<int>(place);
    const double moved = std::max(0.0, fraction(place) * each - kHold_s) / kMove_s;
    const double share = smooth(std::clamp(moved, 0.0, 1.0));
    const Pose a = picture(k), b = picture(k + 1);
    return {a.q.slerp(share, b.q), a.p + share * (b.p - a.p)};
  }

  /// Pose of the body for the k-th image: position of the sheet in the image, slant and distance
  /// are spread evenly (additive recurrence, M. Roberts, "The unreasonable effectiveness of
  /// quasirandom sequences").
  [[nodiscard]] Pose picture(int k) const {
    const CameraMount camera = true_camera();
    const CameraModel& lens = camera.model;
    const double across = fraction(0.5 + 0.7548776662 * k), down = fraction(0.5 + 0.5698402910 * k);
    const double distance = 1.0 + 0.8 * fraction(0.6180339887 * k);
    const double slant = (k % 3 == 0 ? 0.1 : 0.7), turn = 2.399963 * k;
    const double half = kBorder * lens.fu * 0.2 / distance;
    const Eigen::Vector2d raw(half + across * (lens.width - 2 * half),
                              half + down * (lens.height - 2 * half));
    const auto ideal = undistort(lens, raw);
    const Eigen::Vector3d ray =
        Eigen::Vector3d((ideal->px.x() - lens.cu) / lens.fu, (ideal->px.y() - lens.cv) / lens.fv, 1)
            .normalized();
    const Eigen::Vector3d p_TV =
        distance * Eigen::Vector3d(std::sin(slant) * std::cos(turn),
                                   std::sin(slant) * std::sin(turn), std::cos(slant));
    const Eigen::Vector3d ahead = -p_TV.normalized();
    Eigen::Matrix3d R_TV;  // upright before the sheet, its middle straight ahead
    R_TV.col(2) = ahead;
    R_TV.col(0) = (-Eigen::Vector3d::UnitY()).cross(ahead).normalized();
    R_TV.col(1) = ahead.cross(R_TV.col(0));
    const auto turned = rotation_between(ray, Eigen::Vector3d::UnitZ());
    return X_WT_ * Pose{Eigen::Quaterniond(R_TV) * turned, p_TV} * camera.X_BV.inverse();
  }

  std::shared_ptr<std::atomic<SetupStep>> step_;
  Pose X_WT_;
  mutable SetupStep begun_{SetupStep::kCamera};
  mutable double began_s_{0};
};

std::string SetupCommand::text(const std::string& key) const {
  const auto found = values.find(key);
  return found == values.end() ? "" : found->second;
}

std::optional<double> SetupCommand::number(const std::string& key) const {
  double value{};
  if (!parse_number(text(key), value) || !std::isfinite(value)) return std::nullopt;
  return value;
}

SimulatedRig::SimulatedRig(const Clock* clock)
    : clock_(clock), step_(std::make_shared<std::atomic<SetupStep>>(SetupStep::kCamera)) {}

simulation::RoomConfig SimulatedRig::room() { return {}; }

simulation::SimulatedBodyConfig SimulatedRig::body() const {
  simulation::SimulatedBodyConfig body;
  body.cameras = {true_camera()};
  return body;
}

OpenedSource SimulatedRig::open() {
  auto made = simulation::make_simulated_source(room(), body(),
                                                clock_ != nullptr ? clock_->now() : Instant{},
                                                clock_, std::make_unique<Motion>(step_));
  if (!made) return tl::unexpected(made.error());
  return std::unique_ptr<SensorSource>(std::move(*made));
}

void SimulatedRig::begin(SetupStep step) { *step_ = step; }

}  // namespace fiducap
