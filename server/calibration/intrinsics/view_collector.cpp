#include "calibration/intrinsics/view_collector.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "detection/planar_target.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr double kMinSide_px = 20;
constexpr int kUndecimated_px = 800 * 600;  // larger images are searched in every second pixel
constexpr double kBlurred = 0.5;            // relative to the upper quartile of sharpness
constexpr double kEqual = 0.004;            // distance of equal views, in image widths

double sharp_enough(const CalibrationData& all) {
  std::vector<double> sharpness;
  for (const CalibrationView& view : all.views)
    for (const TargetSighting& s : view.sightings)
      if (s.sharpness > 0) sharpness.push_back(s.sharpness);
  return sharpness.empty() ? 0 : kBlurred * nth_smallest(sharpness, sharpness.size() * 3 / 4);
}

}  // namespace

ViewCollector::ViewCollector(CalibrationTargets targets) : targets_(std::move(targets)) {
  if (targets_.board) {
    seen_.push_back(targets_.board->board);
    sees_april_grid_ = targets_.board->is_april_grid;
  }
  if (!targets_.checkerboard) return;
  const Checkerboard& board = *targets_.checkerboard;
  CalibrationTarget target{"checkerboard", {}, false};
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column)
      target.points.emplace_back(column * board.square_m, row * board.square_m, 0);
  seen_.push_back(std::move(target));
}

std::optional<CalibrationView> ViewCollector::look(const std::string& name,
                                                   const std::shared_ptr<const GrayImage>& image) {
  if (targets_.checkerboard) {
    const auto corners =
        find_checkerboard(*image, targets_.checkerboard->columns, targets_.checkerboard->rows);
    if (!corners) return std::nullopt;
    TargetSighting sighting;
    for (std::size_t i = 0; i < corners->size(); ++i)
      sighting.points.push_back({static_cast<int>(i), (*corners)[i], (*corners)[i]});
    return CalibrationView{name, {std::move(sighting)}};
  }
  if (!sees_april_grid_) {
    if (!detector_) {
      DetectorConfig config;
      config.decimate = image->width * image->height > kUndecimated_px ? 2.0 : 1.0;
      detector_.emplace(targets_.tags, config);
    }
    auto view = look(name, detector_->detect(CameraFrame{0, {}, image}));
    if (view || targets_.board || !seen_.empty()) return view;
  }
  if (!april_grid_) april_grid_.emplace();
  CornerFrame corners;
  corners.tags = april_grid_->find(*image);
  auto view = look(name, corners);
  sees_april_grid_ |= view.has_value();
  return view;
}

std::optional<CalibrationView> ViewCollector::look(const std::string& name,
                                                   const CornerFrame& corners) {
  CalibrationView view{name, {}};
  TargetSighting board;
  for (const TagSighting& tag : corners.tags) {
    if (!is_good(corners, tag)) continue;
    if (targets_.board) {
      seen_.front().fitted_sides = corners.fitted_straight_sides;
      add_to_board(tag, board);
      continue;
    }
    TargetSighting sighting;
    sighting.target = target_of(tag.tag_id, corners.fitted_straight_sides);
    sighting.sharpness = tag.sharpness;
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector2d& px = tag.corners_px[static_cast<std::size_t>(i)];
      sighting.points.push_back({i, px, px});
    }
    view.sightings.push_back(std::move(sighting));
  }
  if (!board.points.empty()) {
    board.sharpness /= static_cast<double>(board.points.size()) / 4;
    view.sightings.push_back(std::move(board));
  }
  return view.sightings.empty() ? std::nullopt : std::optional(std::move(view));
}

/// @param sighting  its sharpness is the sum over tags
void ViewCollector::add_to_board(const TagSighting& tag, TargetSighting& sighting) const {
  const auto first = targets_.board->first_corner_of_tag.find(tag.tag_id);
  if (first == targets_.board->first_corner_of_tag.end()) return;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector2d& px = tag.corners_px[static_cast<std::size_t>(i)];
    sighting.points.push_back({first->second + i, px, px});
  }
  sighting.sharpness += tag.sharpness;
}

bool ViewCollector::is_good(const CornerFrame& frame, const TagSighting& tag) const {
  if (std::ranges::count(targets_.tags.ignore, tag.tag_id) > 0) return false;
  if (tag.hamming > 1) return false;
  for (std::size_t i = 0; i < 4; ++i)
    if (!((tag.corners_px[i] - tag.corners_px[(i + 1) % 4]).norm() >= kMinSide_px)) return false;
  return std::ranges::count(frame.tags, tag.tag_id, &TagSighting::tag_id) == 1;
}

int ViewCollector::target_of(int tag_id, bool fitted_sides) {
  const auto known = target_of_tag_.find(tag_id);
  if (known != target_of_tag_.end()) return known->second;
  const int target = static_cast<int>(seen_.size());
  CalibrationTarget made{"tag " + std::to_string(tag_id), {}, fitted_sides};
  for (int i = 0; i < 4; ++i) made.points.push_back(tag_corner(i, targets_.tags.edge_of(tag_id)));
  seen_.push_back(std::move(made));
  target_of_tag_[tag_id] = target;
  return target;
}

double distance(const CalibrationView& a, const CalibrationView& b, int width) {
  double sum = 0;
  std::size_t count = 0;
  for (const TargetSighting& s : a.sightings)
    for (const TargetSighting& t : b.sightings) {
      if (s.target != t.target) continue;
      const std::size_t points = std::min(s.points.size(), t.points.size());
      for (std::size_t i = 0; i < points; ++i)
        sum += (s.points[i].raw_px - t.points[i].raw_px).norm();
      count += points;
    }
  return count == 0 ? 1 : sum / static_cast<double>(count) / width;
}

CalibrationData select_views(const CalibrationData& all, std::size_t most) {
  CalibrationData sharp = all;
  const double limit = sharp_enough(all);
  for (CalibrationView& view : sharp.views)
    std::erase_if(view.sightings,
                  [&](const TargetSighting& s) { return s.sharpness > 0 && s.sharpness < limit; });
  std::erase_if(sharp.views, [](const CalibrationView& view) { return view.sightings.empty(); });
  // Farthest-first selection: each view is the most different from those before.
  std::vector<double> apart(sharp.views.size(), std::numeric_limits<double>::infinity());
  std::vector<bool> taken(sharp.views.size(), false);
  for (std::size_t n = 0, next = 0; n < most && next < sharp.views.size(); ++n) {
    if (!(apart[next] > kEqual)) break;
    taken[next] = true;
    for (std::size_t i = 0; i < apart.size(); ++i)
      apart[i] = std::min(apart[i], distance(sharp.views[i], sharp.views[next], sharp.width));
    next = static_cast<std::size_t>(std::ranges::max_element(apart) - apart.begin());
  }
  CalibrationData out = sharp;
  out.views.clear();
  for (std::size_t i = 0; i < taken.size(); ++i)
    if (taken[i]) out.views.push_back(std::move(sharp.views[i]));
  return out;
}

}  // namespace fiducap
