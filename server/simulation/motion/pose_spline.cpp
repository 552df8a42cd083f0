#include <Eigen/SparseCholesky>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <optional>
#include <string_view>
#include <utility>

#include "base/text.hpp"
#include "simulation/motion/motion.hpp"

namespace fiducap::simulation {

namespace {

using Weights = Eigen::Matrix<double, PoseSpline::kOrder, 1>;
using Vector7d = Eigen::Matrix<double, 7, 1>;

// Uniform quintic B-spline: weight i is Σ kBasis(i, j) u^j / 120.
const Eigen::Matrix<double, 6, 6>& basis() {
  static const Eigen::Matrix<double, 6, 6> matrix = [] {
    Eigen::Matrix<double, 6, 6> m;
    m << 1, -5, 10, -10, 5, -1,    //
        26, -50, 20, 20, -20, 5,   //
        66, 0, -60, 0, 30, -10,    //
        26, 50, 20, -20, -20, 10,  //
        1, 5, 10, 10, 5, -5,       //
        0, 0, 0, 0, 0, 1;
    return Eigen::Matrix<double, 6, 6>(m / 120.0);
  }();
  return matrix;
}

Eigen::Quaterniond quaternion_of(const Vector7d& x) { return {x(3), x(4), x(5), x(6)}; }

constexpr std::size_t kMaxPoses = 2'000'000;  // 2.7 hours at 200 Hz
constexpr std::size_t kMaxLine = 4096;
constexpr double kSpacing_s = 0.1;
constexpr double kMaxLength_s = 86'400;
constexpr double kSmoothness = 1e-3;  // weight of the penalty against one pose per control pose

/// The first eight fields between commas or blanks; nullopt when there are fewer.
std::optional<std::vector<std::string_view>> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  std::size_t at = 0;
  while (at < line.size() && fields.size() < 8) {
    const std::size_t start = line.find_first_not_of(", \t\r", at);
    if (start == std::string_view::npos) break;
    at = std::min(line.find_first_of(", \t\r", start), line.size());
    fields.push_back(line.substr(start, at - start));
  }
  if (fields.size() < 8) return std::nullopt;
  return fields;
}

/// Integer nanoseconds: a double cannot represent Unix time in nanoseconds.
bool read_time(std::string_view text, bool nanoseconds, std::int64_t& ns) {
  if (nanoseconds) return parse_number(text, ns);
  const std::size_t dot = std::min(text.find('.'), text.size());
  std::int64_t whole = 0;
  double part = 0;
  if (!parse_number(text.substr(0, dot), whole) || std::abs(whole) > 9'000'000'000) return false;
  if (dot + 1 < text.size() && !parse_number(text.substr(dot), part)) return false;
  ns = whole * 1'000'000'000 + std::llround(part * 1e9);
  return true;
}

std::optional<std::pair<std::int64_t, Pose>> pose_of(std::string_view line) {
  const auto fields = fields_of(line);
  if (!fields) return std::nullopt;
  const bool euroc = line.find(',') != std::string_view::npos;
  std::int64_t ns = 0;
  std::array<double, 7> x{};
  if (!read_time((*fields)[0], euroc, ns)) return std::nullopt;
  for (std::size_t i = 0; i < x.size(); ++i)
    if (!parse_number((*fields)[i + 1], x[i]) || !std::isfinite(x[i])) return std::nullopt;
  const Eigen::Quaterniond q = euroc ? Eigen::Quaterniond(x[3], x[4], x[5], x[6])
                                     : Eigen::Quaterniond(x[6], x[3], x[4], x[5]);
  if (std::abs(q.norm() - 1.0) > 0.01) return std::nullopt;
  return std::pair{ns, Pose{q.normalized(), {x[0], x[1], x[2]}}};
}

/// Chooses between q and −q so that neighbours have a positive product.
std::vector<Eigen::Vector4d> continuous(const std::vector<TimedPose>& poses) {
  std::vector<Eigen::Vector4d> q;
  for (const TimedPose& pose : poses) {
    const auto& r = pose.X_WB.q;
    Eigen::Vector4d next(r.w(), r.x(), r.y(), r.z());
    if (!q.empty() && next.dot(q.back()) < 0) next = -next;
    q.push_back(next);
  }
  return q;
}

void add_penalty(std::vector<Eigen::Triplet<double>>& normal, Eigen::Index n) {
  constexpr std::array<double, 5> kFourthDifference{1, -4, 6, -4, 1};
  for (Eigen::Index i = 0; i + 4 < n; ++i) {
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 5; ++b)
        normal.emplace_back(i + a, i + b,
                            kSmoothness * kFourthDifference[static_cast<std::size_t>(a)] *
                                kFourthDifference[static_cast<std::size_t>(b)]);
    }
  }
}

}  // namespace

Weights PoseSpline::weights(double u, int derivative) {
  Weights powers = Weights::Zero();
  double power = 1.0;
  for (int j = derivative; j < kOrder; ++j) {
    double factor = 1.0;
    for (int d = 0; d < derivative; ++d) factor *= j - d;
    powers(j) = factor * power;
    power *= u;
  }
  return basis() * powers;
}

PoseSpline::PoseSpline(const std::vector<Pose>& control, double spacing, bool closed)
    : control_(7, static_cast<Eigen::Index>(control.size())), spacing_(spacing), closed_(closed) {
  FIDUCAP_ASSERT(control.size() >= kOrder && spacing > 0);
  const Eigen::Index n = control_.cols();
  for (Eigen::Index i = 0; i < n; ++i) {
    const Pose& X = control[static_cast<std::size_t>(i)];
    Eigen::Vector4d q(X.q.w(), X.q.x(), X.q.y(), X.q.z());
    if (i > 0 && q.dot(control_.col(i - 1).tail<4>()) < 0) q = -q;
    control_.col(i) << X.p, q;
  }
  pieces_ = closed ? n : n - kOrder + 1;
  if (closed && control_.col(n - 1).tail<4>().dot(control_.col(0).tail<4>()) < 0) wrap_sign_ = -1.0;
}

PoseSpline::PoseSpline(Control control, double spacing)
    : control_(std::move(control)),
      spacing_(spacing),
      pieces_(control_.cols() - kOrder + 1),
      closed_(false) {
  FIDUCAP_ASSERT(pieces_ > 0 && spacing > 0);
}

PoseSpline::Point PoseSpline::at(double s) const {
  const auto pieces = static_cast<double>(pieces_);
  double x = s / spacing_;
  x = closed_ ? x - pieces * std::floor(x / pieces) : std::clamp(x, 0.0, pieces);
  const auto piece = std::min(static_cast<Eigen::Index>(x), pieces_ - 1);
  const double u = x - static_cast<double>(piece);
  const Weights w0 = weights(u, 0);
  const Weights w1 = weights(u, 1) / spacing_;
  const Weights w2 = weights(u, 2) / (spacing_ * spacing_);
  Vector7d value = Vector7d::Zero();
  Vector7d first = Vector7d::Zero();
  Point point;
  point.acceleration.setZero();
  for (Eigen::Index i = 0; i < kOrder; ++i) {
    const Eigen::Index n = control_.cols();
    Vector7d c = control_.col((piece + i) % n);
    if (piece + i >= n) c.tail<4>() *= wrap_sign_;
    value += w0(i) * c;
    first += w1(i) * c;
    point.acceleration += w2(i) * c.head<3>();
  }
  // ω = 2 vec(q* q̇) = 2 vec(b* ḃ) / |b|² for an unnormalised b = |b| q.
  const Eigen::Quaterniond b = quaternion_of(value);
  point.rate = 2.0 * (b.conjugate() * quaternion_of(first)).vec() / b.squaredNorm();
  point.X = {b.normalized(), value.head<3>()};
  point.velocity = first.head<3>();
  return point;
}

Expected<std::vector<TimedPose>> read_pose_file(const std::string& path) {
  std::ifstream in(path);
  if (!in)
    return fail(ErrorCode::kNotFound, "expected a file with poses, it cannot be opened", path);
  std::vector<TimedPose> poses;
  std::int64_t first_ns = 0;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    const auto where = [&] { return path + ":" + std::to_string(number); };
    const std::size_t start = line.find_first_not_of(" \t\r");
    if (start == std::string::npos || line[start] == '#') continue;
    const auto pose = line.size() > kMaxLine ? std::nullopt : pose_of(line);
    if (!pose)
      return fail(ErrorCode::kInvalid,
                  "expected `ns,px,py,pz,qw,qx,qy,qz` (EuRoC) or `s px py pz qx qy qz qw` (TUM) "
                  "with a unit quaternion",
                  where());
    if (poses.empty()) first_ns = pose->first;
    const double t_s = static_cast<double>(pose->first - first_ns) * 1e-9;
    if (!poses.empty() && t_s <= poses.back().t_s)
      return fail(ErrorCode::kInvalid, "expected a later time than in the line before", where());
    if (t_s > kMaxLength_s || poses.size() >= kMaxPoses)
      return fail(ErrorCode::kUnsupported, "expected at most a day and 2000000 poses", where());
    poses.push_back({t_s, pose->second});
  }
  if (poses.size() < PoseSpline::kOrder)
    return fail(ErrorCode::kTruncated,
                "expected at least 6 poses, found " + std::to_string(poses.size()), path);
  return poses;
}

PoseSpline fit_spline(const std::vector<TimedPose>& poses) {
  const double length = poses.back().t_s;
  const auto pieces = static_cast<Eigen::Index>(std::max(1.0, std::ceil(length / kSpacing_s)));
  const double spacing = length / static_cast<double>(pieces);
  const Eigen::Index n = pieces + PoseSpline::kOrder - 1;
  std::vector<Eigen::Triplet<double>> normal;
  Eigen::Matrix<double, Eigen::Dynamic, 7> right =
      Eigen::Matrix<double, Eigen::Dynamic, 7>::Zero(n, 7);
  const std::vector<Eigen::Vector4d> q = continuous(poses);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const double x = poses[k].t_s / spacing;
    const auto piece = std::min(static_cast<Eigen::Index>(x), pieces - 1);
    const auto w = PoseSpline::weights(x - static_cast<double>(piece), 0);
    Eigen::Matrix<double, 1, 7> y;
    y << poses[k].X_WB.p.transpose(), q[k].transpose();
    for (Eigen::Index a = 0; a < PoseSpline::kOrder; ++a) {
      right.row(piece + a) += w(a) * y;
      for (Eigen::Index b = 0; b < PoseSpline::kOrder; ++b)
        normal.emplace_back(piece + a, piece + b, w(a) * w(b));
    }
  }
  add_penalty(normal, n);
  Eigen::SparseMatrix<double> A(n, n);
  A.setFromTriplets(normal.begin(), normal.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower,
                              Eigen::NaturalOrdering<int>>
      solver(A);
  const Eigen::Matrix<double, Eigen::Dynamic, 7> control = solver.solve(right);
  return PoseSpline(PoseSpline::Control(control.transpose()), spacing);
}

}  // namespace fiducap::simulation
