#include "detection/points/point_tracker.hpp"

#include <algorithm>
#include <utility>

#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr double kBack_px = 0.4;    // forward-backward error
constexpr double kMotion_px = 1.2;  // from the epipolar line: noise, and error of the rotation
constexpr double kApart_px = 14.0;  // distance of new points
constexpr double kMinDistance_px = 0.5 * kApart_px;  // of tracked points: the newer one is dropped
constexpr double kTagReach = 1.5;  // relative to a tag's half edge: quiet zone and patch included
constexpr int kNewPerImage = 12;   // cells searched for a new point
constexpr float kLeastCorner = 2.5F * patch_flow::kLeastStructure;
constexpr int kBorder_px = patch_flow::kHalf + 3;

/// Ray (x, y, 1).
Eigen::Vector3d ray(const CameraModel& model, const Eigen::Vector2d& ideal_px) {
  return {(ideal_px.x() - model.cu) / model.fu, (ideal_px.y() - model.cv) / model.fv, 1.0};
}

constexpr int kGuesses = 48;  // with 40 % outliers all fail once in 10⁹
constexpr std::size_t kMinPairs = 5;

/// Whether the later ray is near the plane of translation and earlier ray, in units of the rays' x
/// and y.
bool is_near(const RotatedPair& pair, const Eigen::Vector3d& normal, const Eigen::Vector3d& shift,
             double limit) {
  const Eigen::Vector3d line = pair.before.cross(shift);
  const double off = shift.dot(normal);
  // A ray along the translation has no epipolar line and fits.
  return off * off <= limit * limit * line.head<2>().squaredNorm() ||
         normal.squaredNorm() <= limit * limit;
}

}  // namespace

TranslationConsensus::TranslationConsensus(std::size_t usual) {
  normals_.reserve(usual);
  fits_.reserve(usual);
  best_.reserve(usual);
}

std::span<const char> TranslationConsensus::inliers(std::span<const RotatedPair> pairs,
                                                    double limit) {
  best_.assign(pairs.size(), 1);
  if (pairs.size() < kMinPairs) return best_;
  normals_.clear();
  for (const RotatedPair& pair : pairs) normals_.push_back(pair.before.cross(pair.now));
  fits_.resize(pairs.size());
  std::size_t most = 0;
  std::uint32_t random = 12345;
  const auto draw = [&] {
    random = random * 1664525U + 1013904223U;
    return (random >> 8) % pairs.size();
  };
  for (int guess = 0; guess < kGuesses; ++guess) {
    const Eigen::Vector3d shift = normals_[draw()].cross(normals_[draw()]);
    const double length = shift.norm();
    if (!(length > 0)) continue;
    std::size_t count = 0;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      fits_[i] = is_near(pairs[i], normals_[i], shift / length, limit) ? 1 : 0;
      count += static_cast<std::size_t>(fits_[i]);
    }
    if (count <= most) continue;
    most = count;
    std::swap(best_, fits_);
  }
  return best_;
}

PointTracker::PointTracker() {
  points_.reserve(kMost);
  ideal_before_.reserve(kMost);
  pairs_.reserve(kMost);
  out_.reserve(kMost);
}

std::span<const PointSighting> PointTracker::follow(
    const CameraFrame& frame, const CameraModel& model,
    const std::optional<Eigen::Quaterniond>& q_beforeNow, std::span<const TagSighting> tags) {
  const bool same_size = !before_.empty() && before_.image().width == frame.image->width &&
                         before_.image().height == frame.image->height;
  now_.build(frame.image);
  take_quads(tags);
  if (!same_size) points_.clear();
  corners_.reserve(static_cast<std::size_t>((frame.image->width / kColumns + 1) *
                                            (frame.image->height / kRows + 1)));
  follow_all(model, q_beforeNow);
  std::size_t kept = 0;
  for (const Point& point : points_)
    if (!is_near_point(point.raw_px, kMinDistance_px, kept)) points_[kept++] = point;
  points_.resize(kept);
  begin_new(model);
  std::swap(before_, now_);
  return report();
}

void PointTracker::take_quads(std::span<const TagSighting> tags) {
  quads_.clear();
  for (const TagSighting& tag : tags) {
    const Eigen::Vector2d middle = centre_of(tag.corners_px);
    TagCorners quad;
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d out = tag.corners_px[i] - middle;
      quad[i] = middle + kTagReach * out + (patch_flow::kHalf / std::max(out.norm(), 1.0)) * out;
    }
    quads_.push_back(quad);
  }
}

bool PointTracker::on_tag(const Eigen::Vector2d& px) const {
  return std::ranges::any_of(quads_, [&](const TagCorners& quad) {
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d a = quad[(i + 1) % 4] - quad[i];
      const Eigen::Vector2d b = px - quad[i];
      if (a.x() * b.y() - a.y() * b.x() > 0)
        return false;  // corners are counter-clockwise, v grows down
    }
    return true;
  });
}

void PointTracker::follow_all(const CameraModel& model,
                              const std::optional<Eigen::Quaterniond>& q_beforeNow) {
  ideal_before_.clear();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector2d ideal = points_[i].ideal_px;
    if (!follow_one(points_[i], model, q_beforeNow)) continue;
    ideal_before_.push_back(ideal);
    points_[kept++] = points_[i];
  }
  points_.resize(kept);
  if (q_beforeNow) drop_moving(model, *q_beforeNow);
}

bool PointTracker::follow_one(Point& point, const CameraModel& model,
                              const std::optional<Eigen::Quaterniond>& q_beforeNow) {
  Eigen::Vector2d guess = point.raw_px;
  if (q_beforeNow) {
    const Eigen::Vector3d turned = q_beforeNow->conjugate() * ray(model, point.ideal_px);
    if (!(turned.z() > 0)) return false;
    guess = model.project(turned).value_or(guess);
  }
  const auto found = patch_flow::follow(before_, point.raw_px, now_, guess);
  if (!found) return false;
  // Starts from the old position, independent of the forward result.
  const auto back = patch_flow::follow(now_, *found, before_, point.raw_px);
  if (!back || (*back - point.raw_px).norm() > kBack_px || on_tag(*found)) return false;
  const auto ideal = undistort(model, *found);
  if (!ideal) return false;
  point.raw_px = *found;
  point.ideal_px = ideal->px;
  return true;
}

void PointTracker::drop_moving(const CameraModel& model, const Eigen::Quaterniond& q_beforeNow) {
  pairs_.clear();
  for (std::size_t i = 0; i < points_.size(); ++i)
    pairs_.push_back({ray(model, ideal_before_[i]), q_beforeNow * ray(model, points_[i].ideal_px)});
  const std::span<const char> fits = consensus_.inliers(pairs_, kMotion_px / model.fu);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (fits[i] != 0) points_[kept++] = points_[i];
  points_.resize(kept);
}

bool PointTracker::is_near_point(const Eigen::Vector2d& px, double distance_px,
                                 std::size_t count) const {
  return std::ranges::any_of(std::span(points_).first(count), [&](const Point& point) {
    return (point.raw_px - px).squaredNorm() < distance_px * distance_px;
  });
}

void PointTracker::begin_new(const CameraModel& model) {
  const GrayImage& image = now_.image();
  std::array<int, kMost> taken{};
  for (const Point& point : points_) {
    const int column =
        std::clamp(static_cast<int>(point.raw_px.x() * kColumns / image.width), 0, kColumns - 1);
    const int row =
        std::clamp(static_cast<int>(point.raw_px.y() * kRows / image.height), 0, kRows - 1);
    ++taken[static_cast<std::size_t>(row * kColumns + column)];
  }
  int searched = 0;
  for (std::size_t i = 0; i < kMost && searched < kNewPerImage && points_.size() < kMost; ++i) {
    const int cell = next_cell_;
    next_cell_ = (next_cell_ + 1) % static_cast<int>(kMost);
    if (taken[static_cast<std::size_t>(cell)] > 0) continue;
    ++searched;
    const int column = cell % kColumns;
    const int row = cell / kColumns;
    const ImageRegion region{
        std::max(column * image.width / kColumns, kBorder_px),
        std::max(row * image.height / kRows, kBorder_px),
        std::min((column + 1) * image.width / kColumns, image.width - kBorder_px),
        std::min((row + 1) * image.height / kRows, image.height - kBorder_px)};
    const auto corner = corners_.best(image, region, kLeastCorner, [this](int u, int v) {
      const Eigen::Vector2d px(u, v);
      return !is_near_point(px, kApart_px, points_.size()) && !on_tag(px);
    });
    const auto ideal = corner ? undistort(model, *corner) : std::nullopt;
    if (!ideal) continue;
    points_.push_back({next_track_++, 0, *corner, ideal->px});
  }
}

std::span<const PointSighting> PointTracker::report() {
  out_.clear();
  if (images_++ % kReportEvery != 0) return out_;
  for (Point& point : points_) {
    out_.push_back({point.track, point.reports, point.raw_px});
    ++point.reports;
  }
  return out_;
}

}  // namespace fiducap
