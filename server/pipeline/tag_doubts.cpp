#include "pipeline/tag_doubts.hpp"

#include <fmt/format.h>

#include <cmath>

namespace fiducap {

namespace {
constexpr std::size_t kMostSaid = 20;
constexpr double kPercent = 100;
constexpr Duration kPatienceWithBranch = std::chrono::seconds(5);
constexpr Duration kPatienceWithWitness = std::chrono::seconds(1);
constexpr double kWorthAWord_m = 0.05;
}  // namespace

std::string size_text(const SizeFinding& finding) {
  if (!finding.tag_id) {
    return fmt::format(
        "all tags look {:.2f} (± {:.2f}) times their configured size: is tags.size_m the edge of "
        "the black square?",
        finding.ratio, finding.sigma);
  }
  return fmt::format(
      "tag {} looks {:.0f} % {} than its configured {:.3f} m ({:.3f} ± {:.3f} m): measure it, or "
      "set tags.sizes_m",
      *finding.tag_id, kPercent * std::abs(finding.ratio - 1),
      finding.ratio > 1 ? "larger" : "smaller", finding.edge_m, finding.ratio * finding.edge_m,
      finding.sigma * finding.edge_m);
}

std::string rejection_text(double share, bool has_imu) {
  return fmt::format(
      "{:.0f} % of the tags seen within ten seconds contradicted the rest. Look at, in this order: "
      "printed sizes (tags.size_m, "
      "tags.sizes_m); the camera's calibration (lens, resolution){}; tags that move, or are there "
      "twice",
      kPercent * share, has_imu ? "; where the camera sits on the IMU; the clocks" : "");
}

std::string TagDoubts::add(const TagObservations& seen, const UpdateReport& report,
                           const std::optional<BodyEstimate>& estimate,
                           std::span<const TagBelief> own, std::span<const KnownTag> known) {
  std::string text;
  if (const auto share = rejections_.add(report)) text = rejection_text(*share, has_imu_);
  if (estimate) {
    sizes_.add({seen, *estimate, report, own, known});
    if (const auto finding = sizes_.take_news())
      text += (text.empty() ? "" : "; ") + size_text(*finding);
  }
  const std::string up = up_.add(seen.exposed_at, estimate, own, known);
  if (!up.empty()) text += (text.empty() ? "" : "; ") + up;
  for (const std::string& wait :
       {wait_for_branch(report, estimate.has_value()), wait_for_witness(report)})
    if (!wait.empty()) text += (text.empty() ? "" : "; ") + wait;
  if (text.empty()) return text;
  const std::lock_guard lock(mutex_);
  if (said_.size() < kMostSaid) said_.push_back(text);
  return text;
}

std::string TagDoubts::wait_for_branch(const UpdateReport& report, bool has_pose) {
  if (has_imu_ || has_pose) {
    waits_since_.reset();
    is_wait_told_ = false;
    return {};
  }
  if (report.tags_pending == 0 || is_wait_told_) return {};
  if (!waits_since_) waits_since_ = report.exposed_at;
  if (report.exposed_at - *waits_since_ < kPatienceWithBranch) return {};
  is_wait_told_ = true;
  return "no pose: the tags in view are so small that their corners allow two poses, and without "
         "an "
         "IMU nothing else tells which. Come nearer, look at them from aside, or show more of the "
         "tags that are known";
}

std::string TagDoubts::wait_for_witness(const UpdateReport& report) {
  if (!report.elsewhere) {
    elsewhere_since_.reset();
    is_elsewhere_told_ = false;
    return {};
  }
  if (!elsewhere_since_) elsewhere_since_ = report.exposed_at;
  if (is_elsewhere_told_ || report.elsewhere->by_m < kWorthAWord_m) return {};
  if (report.exposed_at - *elsewhere_since_ < kPatienceWithWitness) return {};
  is_elsewhere_told_ = true;
  return fmt::format(
      "tag {} says that the body is {:.2f} m from where it is thought to be: the tag was moved, or "
      "the body went astray. Until another known tag decides, the pose is no surer than that",
      report.elsewhere->tag_id, report.elsewhere->by_m);
}

std::vector<std::string> TagDoubts::said() const {
  const std::lock_guard lock(mutex_);
  return said_;
}

}  // namespace fiducap
