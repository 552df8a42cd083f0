#include "pipeline/camera_view.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "detection/observe.hpp"
#include "detection/tag_geometry.hpp"
#include "pipeline/pose_trust.hpp"

namespace fiducap {
namespace {

/// Inputs for classifying the sightings of one image.
struct ViewInput {
  const PipelineSetup& setup;
  const BodyUpdate& update;
  const TagMap& map;
  std::span<const FoundMismatch> mismatches;
};

/// Before any filter has seen it.
std::optional<UnusedBecause> why_not_observed(const TagSighting& tag, const ViewInput& in) {
  switch (rejection_of(tag, in.setup.tags, in.setup.detector)) {
    case Rejection::kIgnored:
      return UnusedBecause::kIgnored;
    case Rejection::kCorrectedBits:
      return UnusedBecause::kCorrectedBits;
    case Rejection::kLowMargin:
      return UnusedBecause::kLowMargin;
    case Rejection::kNone:
      break;
  }
  if (std::ranges::count(in.update.seen.tags, tag.tag_id, &TagObservation::tag_id) > 0)
    return std::nullopt;
  const auto& all = in.update.corners.tags;
  const auto usable_ones = std::ranges::count_if(all, [&](const TagSighting& one) {
    return one.tag_id == tag.tag_id &&
           rejection_of(one, in.setup.tags, in.setup.detector) == Rejection::kNone;
  });
  return usable_ones > 1 ? UnusedBecause::kIdTwice : UnusedBecause::kOutsideLens;
}

bool has_wrong_size(int tag_id, std::span<const FoundMismatch> mismatches) {
  return std::ranges::any_of(mismatches, [&](const FoundMismatch& one) {
    return one.kind == FoundMismatch::Kind::kOnePrint && one.tag_id == tag_id;
  });
}

/// The body's own belief of it.
const TagBelief* find_own(int tag_id, const BodyUpdate& update) {
  const auto found = std::ranges::find_if(
      update.beliefs, [&](const TagBelief& belief) { return belief.tag.tag_id == tag_id; });
  return found == update.beliefs.end() ? nullptr : &*found;
}

/// By the filter's state afterwards: an own tag has the time of its last use, a fitting tag of the
/// map is listed (up to kMostFitting).
bool is_used(int tag_id, const BodyUpdate& update) {
  const UpdateReport& report = update.report;
  const TagBelief* own = find_own(tag_id, update);
  if (own != nullptr && own->last_seen == update.seen.exposed_at) return true;
  if (std::ranges::count(report.named_fitting(), tag_id) > 0) return true;
  return own == nullptr && report.tags_rejected == 0 &&
         report.tags_fitting > static_cast<int>(UpdateReport::kMostFitting);
}

UnusedBecause why_not_used(const TagSighting& tag, const ViewInput& in) {
  if (const auto why = why_not_observed(tag, in)) return *why;
  const UpdateReport& report = in.update.report;
  if (std::ranges::count(report.named_dropped(), tag.tag_id) > 0) return UnusedBecause::kMoved;
  if (is_used(tag.tag_id, in.update)) return UnusedBecause::kUsed;
  const MapTag* in_map = in.map.find(tag.tag_id);
  if (in_map != nullptr && in_map->state == TagState::kQuarantined)
    return UnusedBecause::kQuarantined;
  if (report.start_is_open) return UnusedBecause::kPending;
  const bool has_place = find_own(tag.tag_id, in.update) != nullptr ||
                         std::ranges::count(in.update.known, tag.tag_id, &KnownTag::tag_id) > 0;
  if (has_place && report.tags_rejected > 0)
    return has_wrong_size(tag.tag_id, in.mismatches) ? UnusedBecause::kWrongSize
                                                     : UnusedBecause::kGate;
  if (report.tags_pending > 0) return UnusedBecause::kPending;
  return report.running ? UnusedBecause::kUnstable : UnusedBecause::kNoPlace;
}

double fit_of(int tag_id, const UpdateReport& report) {
  for (const auto& fit : report.named_fits())
    if (fit.tag_id == tag_id) return fit.rms_px;
  return ViewOutline::kUnknown;
}

ViewOutline outline_of(const TagSighting& tag, UnusedBecause why, const BodyUpdate& update) {
  ViewOutline out;
  const bool uses_it = why == UnusedBecause::kUsed;
  out.kind = uses_it ? ViewOutline::Kind::kUsed : ViewOutline::Kind::kRejected;
  out.tag_id = tag.tag_id;
  out.why = why;
  const TagBelief* own = find_own(tag.tag_id, update);
  out.is_new = uses_it && own != nullptr && own->sightings <= 1;
  out.hamming = tag.hamming;
  out.decision_margin = tag.decision_margin;
  out.sharpness = tag.sharpness;
  out.fit_px = fit_of(tag.tag_id, update.report);
  out.corners_px = tag.corners_px;
  return out;
}

/// Of a point at this depth.
double speed_at(const Eigen::Vector2d& px, double depth_m, const CameraMount& camera,
                const BodyEstimate& body) {
  const CameraModel& model = camera.model;
  const Eigen::Vector3d ray((px.x() - model.cu) / model.fu, (px.y() - model.cv) / model.fv, 1);
  const Eigen::Quaterniond q_VB = camera.X_BV.q.conjugate();
  const Eigen::Vector3d w_V = q_VB * body.w_WB_B;
  const Eigen::Vector3d v_V = q_VB * (body.X_WB.q.conjugate() * body.v_WB);
  const Eigen::Vector3d moved = -w_V.cross(ray) - v_V / depth_m;
  return std::hypot(model.fu * (moved.x() - ray.x() * moved.z()),
                    model.fv * (moved.y() - ray.y() * moved.z()));
}

double speed_of(const BodyUpdate& update, const CameraMount& camera) {
  constexpr double kFar_m = 1e6;
  constexpr double kLeast_px = 1;
  if (!update.estimate) return ViewOutline::kUnknown;
  const CameraModel& model = camera.model;
  if (update.seen.tags.empty())
    return speed_at({model.cu, model.cv}, kFar_m, camera, *update.estimate);
  double fastest = 0;
  for (const TagObservation& tag : update.seen.tags) {
    const auto side_px = fiducap::outline_of(tag.corners_px).longest_px;
    const double depth_m = model.fu * tag.edge_m / std::max(kLeast_px, side_px);
    const Eigen::Vector2d middle = 0.5 * (tag.corners_px[0] + tag.corners_px[2]);
    fastest = std::max(fastest, speed_at(middle, depth_m, camera, *update.estimate));
  }
  return fastest;
}

}  // namespace

std::string_view name_of(UnusedBecause why) {
  constexpr std::array<std::string_view, 14> kNames{
      "used",         "ignored",     "corrected_bits", "low_margin", "id_twice",
      "outside_lens", "quarantined", "gate",           "wrong_size", "moved",
      "restless",     "pending",     "no_place",       "late"};
  return kNames.at(static_cast<std::size_t>(why));
}

void fill(CameraView& view, const BodyPipeline& pipeline, const BodyUpdate& update,
          const TagMap& map) {
  const CornerFrame& corners = update.corners;
  const CameraMount& camera =
      pipeline.setup().sensors.cameras[static_cast<std::size_t>(corners.camera)];
  view.camera = corners.camera;
  view.exposed_at = corners.exposed_at;
  view.width = view.image ? view.image->width : camera.model.width;
  view.height = view.image ? view.image->height : camera.model.height;
  view.pixel_noise = corners.pixel_noise;
  view.speed_px_s = speed_of(update, camera);
  view.outlines.clear();
  view.sightings.clear();
  const ViewInput input{pipeline.setup(), update, map, pipeline.mismatches()};
  const bool is_excluded =
      pipeline.late().excludes(corners.camera, corners.exposed_at - corners.clock_shift);
  for (const TagSighting& tag : corners.tags) {
    if (view.outlines.size() == CameraView::kMostOutlines) break;
    view.sightings.push_back(tag);
    const auto why = is_excluded ? UnusedBecause::kLate : why_not_used(tag, input);
    view.outlines.push_back(outline_of(tag, why, update));
  }
  for (const ExpectedTag& tag : pipeline.expected()) {
    if (view.outlines.size() == CameraView::kMostOutlines) break;
    if (!tag.known) continue;  // predicted by its last sighting, not by the map
    ViewOutline out;
    out.kind = ViewOutline::Kind::kExpected;
    out.tag_id = tag.tag_id;
    out.sigma_px = tag.sigma_px;
    out.corners_px = tag.corners_px;
    view.outlines.push_back(out);
  }
}

}  // namespace fiducap
