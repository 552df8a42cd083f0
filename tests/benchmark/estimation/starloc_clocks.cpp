#include "estimation/starloc.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/Dense>

#include "base/pose.hpp"
#include "estimation/options.hpp"

namespace fiducap::bench {
namespace {

constexpr double kBend_px = 5;  // Cauchy; the centres fit to some pixels only
constexpr double kLost_px = 500;
constexpr double kFarthest_s = 2;

/// rotation, translation (rig axes), offset, drift
using Camera8 = Eigen::Matrix<double, 8, 1>;

/// The camera's least squares problem; all derivatives by differences.
class CameraFit final {
 public:
  explicit CameraFit(const StarlocRun& run) : run_(run), middle_s_(middle_of(run)) {}

  /// Left u v, right u v, of every centre; a centre without truth is left out (zero).
  [[nodiscard]] Eigen::VectorXd residuals(const Camera8& x) const {
    const Pose X_RV{(exp_so3(x.head<3>()) * run_.X_RV.q).normalized(),
                    run_.X_RV.p + x.segment<3>(3)};
    Eigen::VectorXd out = Eigen::VectorXd::Zero(4 * static_cast<Eigen::Index>(run_.centres.size()));
    Eigen::Index at = 0;
    for (const auto& centre : run_.centres) {
      const double t_s = centre.t_s + x(6) + x(7) * (centre.t_s - middle_s_);
      const auto X_WR = run_.rig_at(t_s);
      const auto tag = run_.tags.find(centre.tag_id);
      if (X_WR && tag != run_.tags.end())
        out.segment<4>(at) = miss((*X_WR * X_RV).inverse() * tag->second, centre);
      at += 4;
    }
    return out;
  }

  [[nodiscard]] static double cost(const Eigen::VectorXd& r) {
    double sum = 0;
    for (Eigen::Index i = 0; i < r.size(); i += 4)
      sum += std::log1p(r.segment<4>(i).squaredNorm() / (4 * kBend_px * kBend_px));
    return sum;
  }

  /// @param free  how many of the eight: 6 keeps offset and drift
  Camera8 solve(Camera8 x, int free, int steps) {
    double now = cost(residuals(x));
    double damping = 1e-3;
    for (int i = 0; i < steps; ++i) {
      const auto [A, b] = normal_equations(x, free);
      Eigen::MatrixXd damped = A;
      damped.diagonal() *= 1 + damping;
      Camera8 next = x;
      next.head(free) -= damped.ldlt().solve(b);
      const double then = cost(residuals(next));
      if (then < now) {
        x = next;
        now = then;
        damping *= 0.2;
      } else {
        damping *= 10;
      }
      information_ = A;
    }
    return x;
  }

  [[nodiscard]] const Eigen::MatrixXd& information() const { return information_; }

 private:
  [[nodiscard]] Eigen::Vector4d miss(const Eigen::Vector3d& p_V,
                                     const StarlocRun::Centre& centre) const {
    if (p_V.z() < 0.1) return Eigen::Vector4d::Constant(kLost_px);
    const Eigen::Vector2d left = run_.camera.pinhole(p_V) - centre.left_px;
    const Eigen::Vector2d right =
        run_.camera.pinhole(p_V - Eigen::Vector3d(run_.baseline_m, 0, 0)) - centre.right_px;
    return Eigen::Vector4d(left.x(), left.y(), right.x(), right.y());
  }

  [[nodiscard]] std::pair<Eigen::MatrixXd, Eigen::VectorXd> normal_equations(const Camera8& x,
                                                                             int free) const {
    constexpr std::array<double, 8> kSteps{1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-4, 2e-2, 2e-4};
    const Eigen::VectorXd r = residuals(x);
    Eigen::MatrixXd J(r.size(), free);
    for (int i = 0; i < free; ++i) {
      const double step = kSteps[static_cast<std::size_t>(i)];
      Camera8 up = x, down = x;
      up(i) += step;
      down(i) -= step;
      J.col(i) = (residuals(up) - residuals(down)) / (2 * step);
    }
    Eigen::VectorXd weight(r.size());
    for (Eigen::Index i = 0; i < r.size(); i += 4)
      weight.segment<4>(i).setConstant(
          r.segment<4>(i).isZero(0)
              ? 0
              : 1 / (1 + r.segment<4>(i).squaredNorm() / (4 * kBend_px * kBend_px)));
    const Eigen::MatrixXd WJ = weight.asDiagonal() * J;
    return {J.transpose() * WJ, WJ.transpose() * r};
  }

  const StarlocRun& run_;
  double middle_s_;
  Eigen::MatrixXd information_;
};

/// Standard deviation of the offset over windows of 10 s, with all other parameters of the whole
/// run.
double scatter_of_windows(const StarlocRun& run, const CameraFit& fit, const Camera8& found) {
  constexpr double kWindow_s = 10, kReach_s = 0.1, kStep_s = 0.002;
  constexpr int kEnough = 25;                     // centres
  std::map<int, std::map<double, double>> costs;  // window, offset
  std::map<int, int> counts;
  for (double change = -kReach_s; change <= kReach_s; change += kStep_s) {
    Camera8 x = found;
    x(6) += change;
    const Eigen::VectorXd r = fit.residuals(x);
    for (std::size_t i = 0; i < run.centres.size(); ++i) {
      const int window =
          static_cast<int>((run.centres[i].t_s - run.centres.front().t_s) / kWindow_s);
      costs[window][change] += CameraFit::cost(r.segment<4>(4 * static_cast<Eigen::Index>(i)));
      counts[window] += change == -kReach_s ? 1 : 0;
    }
  }
  double sum = 0, squares = 0;
  int n = 0;
  for (const auto& [window, cost] : costs) {
    if (counts[window] < kEnough) continue;
    const auto best = std::min_element(
        cost.begin(), cost.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    sum += best->first;
    squares += best->first * best->first;
    ++n;
  }
  return n < 2 ? 0 : std::sqrt((squares - sum * sum / n) / (n - 1));
}

void measure_images(const StarlocRun& run, CameraClock& out) {
  std::vector<double> periods;
  double last = -1;
  for (const auto& centre : run.centres) {
    if (centre.t_s == last) continue;
    ++out.images;
    if (last >= 0) periods.push_back(centre.t_s - last);
    last = centre.t_s;
  }
  out.period_median_s = median(periods);
  out.longest_gap_s = periods.empty() ? 0 : *std::max_element(periods.begin(), periods.end());
}

/// Rotation by the gyroscope since the first sample (each axis by itself: for short intervals).
class GyroIntegral final {
 public:
  explicit GyroIntegral(const StarlocRun& run) : imu_(run.imu), sums_(imu_.size()) {
    sums_[0].setZero();
    for (std::size_t i = 1; i < imu_.size(); ++i)
      sums_[i] =
          sums_[i - 1] + (imu_[i].t_s - imu_[i - 1].t_s) * 0.5 * (imu_[i].w_I + imu_[i - 1].w_I);
  }

  /// Mean rate over [from, to]; nullopt outside or across a hole.
  [[nodiscard]] std::optional<Eigen::Vector3d> mean(double from, double to) const {
    const auto a = at(from);
    const auto b = at(to);
    if (!a || !b) return std::nullopt;
    return Eigen::Vector3d((*b - *a) / (to - from));
  }

 private:
  [[nodiscard]] std::optional<Eigen::Vector3d> at(double t_s) const {
    const auto after = std::lower_bound(imu_.begin(), imu_.end(), t_s,
                                        [](const auto& s, double t) { return s.t_s < t; });
    if (after == imu_.begin() || after == imu_.end()) return std::nullopt;
    const auto i = static_cast<std::size_t>(after - imu_.begin());
    constexpr double kHole_s = 0.05;
    const double step = imu_[i].t_s - imu_[i - 1].t_s;
    if (step > kHole_s) return std::nullopt;
    return Eigen::Vector3d(sums_[i - 1] +
                           (t_s - imu_[i - 1].t_s) / step * (sums_[i] - sums_[i - 1]));
  }

  const std::vector<StarlocRun::Inertial>& imu_;
  std::vector<Eigen::Vector3d> sums_;
};

/// Mean rates of Vicon (rig axes) and gyro over the same 50 ms.
struct RatePair {
  double t_s{};
  Eigen::Vector3d w_R;
  Eigen::Vector3d w_I;
};

constexpr double kHalf_s = 0.025;

std::vector<RatePair> pair_rates(const StarlocRun& run, const GyroIntegral& gyro, double offset_s,
                                 double from_s, double to_s) {
  std::vector<RatePair> pairs;
  double next = from_s;
  for (const auto& place : run.truth) {
    if (place.t_s < next || place.t_s > to_s) continue;
    next = place.t_s + kHalf_s;
    constexpr double kHole_s = 0.03;
    const auto before = run.rig_at(place.t_s - kHalf_s, kHole_s);
    const auto after = run.rig_at(place.t_s + kHalf_s, kHole_s);
    const auto w_I = gyro.mean(place.t_s - offset_s - kHalf_s, place.t_s - offset_s + kHalf_s);
    if (!before || !after || !w_I) continue;
    pairs.push_back({place.t_s, log_so3(before->q.conjugate() * after->q) / (2 * kHalf_s), *w_I});
  }
  return pairs;
}

/// Rotation from gyroscope rates to rig rates, by singular values (Kabsch), without biases.
Eigen::Quaterniond align(const std::vector<RatePair>& pairs) {
  Eigen::Vector3d mean_R = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_I = Eigen::Vector3d::Zero();
  for (const RatePair& p : pairs) {
    mean_R += p.w_R / static_cast<double>(pairs.size());
    mean_I += p.w_I / static_cast<double>(pairs.size());
  }
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  for (const RatePair& p : pairs) H += (p.w_R - mean_R) * (p.w_I - mean_I).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(H, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double proper = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const Eigen::Matrix3d R =
      svd.matrixU() * Eigen::Vector3d(1, 1, proper).asDiagonal() * svd.matrixV().transpose();
  return Eigen::Quaterniond(R);
}

double misfit(const std::vector<RatePair>& pairs, const Eigen::Quaterniond& q_RI) {
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();
  const auto n = static_cast<double>(pairs.size());
  for (const RatePair& p : pairs) bias += (p.w_R - q_RI * p.w_I) / n;
  double sum = 0;
  for (const RatePair& p : pairs) sum += (p.w_R - q_RI * p.w_I - bias).squaredNorm();
  return std::sqrt(sum / n);
}

struct OffsetFound {
  double offset_s{};
  double rms{std::numeric_limits<double>::infinity()};
  Eigen::Quaterniond q_RI{Eigen::Quaterniond::Identity()};
};

/// The offset with the least misfit within ±`reach`. @param q_RI  null: estimated
OffsetFound search_offset(const StarlocRun& run, const GyroIntegral& gyro, double reach,
                          double step, double from_s, double to_s, const Eigen::Quaterniond* q_RI) {
  constexpr std::size_t kEnough = 40;
  OffsetFound best;
  for (double offset = -reach; offset <= reach; offset += step) {
    const auto pairs = pair_rates(run, gyro, offset, from_s, to_s);
    if (pairs.size() < kEnough) continue;
    const Eigen::Quaterniond q = q_RI != nullptr ? *q_RI : align(pairs);
    const double rms = misfit(pairs, q);
    if (rms < best.rms) best = {offset, rms, q};
  }
  return best;
}

void measure_steps(const StarlocRun& run, ImuClock& out) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < run.imu.size(); ++i)
    steps.push_back(run.imu[i].t_s - run.imu[i - 1].t_s);
  out.period_median_s = median(steps);
  const auto lost = std::count_if(steps.begin(), steps.end(),
                                  [&](double s) { return s > 1.5 * out.period_median_s; });
  out.lost_share = static_cast<double>(lost) / static_cast<double>(steps.size());
  out.longest_gap_s = *std::max_element(steps.begin(), steps.end());
}

}  // namespace

double middle_of(const StarlocRun& run) {
  return (run.centres.front().t_s + run.centres.back().t_s) / 2;
}

CameraClock measure_camera_clock(const StarlocRun& run) {
  CameraFit fit(run);
  Camera8 best = Camera8::Zero();
  double least = std::numeric_limits<double>::infinity();
  for (double offset = -kFarthest_s; offset <= kFarthest_s; offset += 0.1) {
    Camera8 x = Camera8::Zero();
    x(6) = offset;
    x = fit.solve(x, 6, 8);
    const double cost = CameraFit::cost(fit.residuals(x));
    if (cost >= least) continue;
    least = cost;
    best = x;
  }
  best = fit.solve(fit.solve(best, 7, 20), 8, 20);
  const Eigen::VectorXd r = fit.residuals(best);
  std::vector<double> misses;
  for (Eigen::Index i = 0; i < r.size(); i += 4)
    if (!r.segment<4>(i).isZero(0)) misses.push_back(r.segment<2>(i).norm());
  CameraClock out;
  out.X_RV = {(exp_so3(best.head<3>()) * run.X_RV.q).normalized(), run.X_RV.p + best.segment<3>(3)};
  out.offset_s = best(6);
  out.window_scatter_s = scatter_of_windows(run, fit, best);
  out.drift = best(7);
  out.reprojection_median_px = median(misses);
  // Median of a Rayleigh variable is 1.18 sigma.
  const double sigma_px = out.reprojection_median_px / 1.18;
  const Eigen::MatrixXd P = sigma_px * sigma_px * fit.information().inverse();
  out.offset_sigma_s = std::sqrt(P(6, 6));
  out.drift_sigma = std::sqrt(P(7, 7));
  measure_images(run, out);
  return out;
}

ImuClock measure_imu_clock(const StarlocRun& run) {
  const GyroIntegral gyro(run);
  const double from_s = run.truth.front().t_s;
  const double to_s = run.truth.back().t_s;
  ImuClock out;
  const OffsetFound rough = search_offset(run, gyro, 1.0, 0.01, from_s, to_s, nullptr);
  out.q_RI = rough.q_RI;
  out.offset_s = rough.offset_s;
  out.rate_rms_rad_s = rough.rms;
  constexpr double kWindow_s = 10;
  std::vector<std::pair<double, double>> windows;
  for (double at = from_s; at + kWindow_s <= to_s; at += kWindow_s) {
    const auto found = search_offset(run, gyro, std::abs(out.offset_s) + 0.1, 0.001, at,
                                     at + kWindow_s, &out.q_RI);
    if (std::isfinite(found.rms)) windows.emplace_back(at + kWindow_s / 2, found.offset_s);
  }
  double mean_t = 0, mean_o = 0, tt = 0, to = 0, oo = 0;
  const auto n = static_cast<double>(windows.size());
  for (const auto& [t, o] : windows) {
    mean_t += t / n;
    mean_o += o / n;
  }
  for (const auto& [t, o] : windows) {
    tt += (t - mean_t) * (t - mean_t);
    to += (t - mean_t) * (o - mean_o);
    oo += (o - mean_o) * (o - mean_o);
  }
  if (windows.size() > 1) {
    out.offset_s = mean_o;
    out.drift = to / tt;
    out.window_scatter_s = std::sqrt(oo / (n - 1));
  }
  measure_steps(run, out);
  return out;
}

}  // namespace fiducap::bench
