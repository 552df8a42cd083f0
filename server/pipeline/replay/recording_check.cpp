#include "pipeline/replay/recording_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <utility>

#include "base/text.hpp"
#include "capture/recording/recording_layout.hpp"
#include "capture/recording/recording_source.hpp"
#include "detection/observe.hpp"
#include "detection/tag_family.hpp"
#include "pipeline/imu_plausibility.hpp"
#include "pipeline/replay/offline_run.hpp"
#include "pipeline/rotation_agreement.hpp"

namespace fiducap {
namespace {

// A recorder starts and stops its streams one after the other.
constexpr double kTogether_s = 1;
constexpr double kLeastCovered = 0.1;
// Share of lines out of order that makes a file unusable; fewer are reported when they are dropped.
constexpr double kTooManyLeftOut = 0.5;

struct Unit {
  double ns{};
  const char* name{};
};
constexpr std::array<Unit, 3> kUnits{
    Unit{1e9, "seconds"}, {1e6, "milliseconds"}, {1e3, "microseconds"}};

bool similar(double a, double b, double factor) { return a < b * factor && b < a * factor; }

/// Of a tag seen from the front the corners run counter-clockwise; v grows down.
bool is_mirrored(const TagSighting& tag) {
  double twice_area = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d& a = tag.corners_px[i];
    const Eigen::Vector2d& b = tag.corners_px[(i + 1) % 4];
    twice_area += a.x() * b.y() - a.y() * b.x();
  }
  return twice_area > 0;
}

std::string wrong_unit_text(const RecordedStream& stream, const char* unit) {
  return stream.file + ": its stamps seem to be " + unit + "; whole nanoseconds are expected";
}

std::string empty_text(const RecordedStream& stream, const char* what) {
  const std::string& found = stream.first_unreadable;
  if (found.find('.') != std::string::npos &&
      found.find_first_not_of("0123456789.+-eE") == std::string::npos)
    return wrong_unit_text(stream, "seconds") + ", not '" + found + "'";
  if (stream.unreadable > 1)
    return stream.file + ": no line of it begins with a stamp in nanoseconds ('" + found + "')";
  return stream.file + ": has no " + what;
}

class RecordingChecker final {
 public:
  RecordingChecker(const RecordingInfo& info, RecordingLayout layout)
      : info_(info), layout_(std::move(layout)), setup_(offline_setup(info)) {}

  Expected<RecordingReport> check() {
    if (const auto read = read_stamps(); !read) return tl::unexpected(read.error());
    if (const auto read = read_samples(); !read) return tl::unexpected(read.error());
    judge_family();
    judge_imu_file();
    judge_images();
    judge_clocks();
    judge_readings();
    judge_corners();
    judge_order();
    std::ranges::stable_sort(
        report_.findings, [](const auto& a, const auto& b) { return a.unusable && !b.unusable; });
    return std::move(report_);
  }

 private:
  Expected<RecordedStream> read_stream(const std::filesystem::path& path, double rate_hz,
                                       Duration shift) {
    const auto column = StampColumn::read(path);
    if (!column) return tl::unexpected(column.error());
    const bool any = column->stamps() > 0;
    return RecordedStream{path.lexically_relative(layout_.folder()).string(),
                          column->stamps(),
                          column->left_out(),
                          column->unreadable(),
                          column->first_unreadable(),
                          rate_hz,
                          any ? column->first() + shift : Instant{},
                          any ? column->last() + shift : Instant{},
                          column->step()};
  }

  Expected<void> read_stamps() {
    const auto add = [&](const std::filesystem::path& path, double rate_hz,
                         Duration shift) -> Expected<void> {
      auto stream = read_stream(path, rate_hz, shift);
      if (!stream) return tl::unexpected(stream.error());
      report_.streams.push_back(std::move(*stream));
      return {};
    };
    if (info_.imu) {
      if (const auto added = add(layout_.imu_csv(), info_.imu->rate_hz, {}); !added) return added;
      imu_ = 0;
    }
    for (std::size_t k = 0; k < info_.cameras.size(); ++k) {
      const CameraMount& mount = info_.cameras[k];
      const bool frames = !has_images(k) && has_corners(k) && is_file(layout_.frames_csv(k));
      std::vector<std::filesystem::path> files;
      if (has_images(k)) {
        files = {layout_.images_csv(k)};
      } else if (has_corners(k)) {
        files = {layout_.corners_csv(k)};
        if (frames) files.push_back(layout_.frames_csv(k));
      }
      for (const auto& file : files)
        if (const auto added = add(file, mount.rate_hz, mount.time_shift); !added) return added;
      if (!files.empty()) cameras_.push_back(report_.streams.size() - 1);
    }
    return {};
  }

  /// IMU and corners by time, without images.
  Expected<void> read_samples() {
    RecordingInfo without_images = info_;
    without_images.has_images.assign(info_.cameras.size(), false);
    without_images.has_corners.resize(info_.cameras.size());
    for (std::size_t k = 0; k < info_.cameras.size(); ++k)
      if (has_images(k)) without_images.has_corners[k] = false;
    const bool any_corners =
        std::ranges::any_of(without_images.has_corners, [](bool has) { return has; });
    if (!any_corners && !info_.imu) return {};
    GrayImagePool pool;
    auto streams = open_streams(without_images, pool);
    if (!streams) return tl::unexpected(streams.error());
    const auto next_of = [](SampleStream& stream) {
      return std::visit([](auto& s) { return s.next(); }, stream);
    };
    std::vector<std::optional<SensorSample>> heads;
    for (SampleStream& stream : *streams) heads.push_back(next_of(stream));
    for (;;) {
      std::size_t first = heads.size();
      for (std::size_t i = 0; i < heads.size(); ++i)
        if (heads[i] && (first == heads.size() || time_of(*heads[i]) < time_of(*heads[first])))
          first = i;
      if (first == heads.size()) return {};
      look_at(*heads[first]);
      heads[first] = next_of((*streams)[first]);
    }
  }

  void look_at(const SensorSample& sample) {
    if (const auto* imu = std::get_if<ImuSample>(&sample)) {
      if (!imu->w_WB_B.allFinite() || !imu->f_B.allFinite()) return;
      plausibility_.add(*imu);
      agreement_.add(*imu);
    } else {
      const auto& frame = std::get<CornerFrame>(sample);
      const CameraModel& model = info_.cameras[static_cast<std::size_t>(frame.camera)].model;
      for (const TagSighting& tag : frame.tags) {
        ++sightings_;
        mirrored_ += is_mirrored(tag) ? 1 : 0;
      }
      observe(frame, model, setup_.tags, setup_.detector, seen_);
      agreement_.add(seen_);
    }
    const ImuFaults before =
        std::exchange(imu_faults_, plausibility_.faults(agreement_.has_degrees()));
    if (before == imu_faults_) return;
    const auto more = faults_to_report(before, imu_faults_);
    faults_.insert(faults_.end(), more.begin(), more.end());
  }

  /// The likely unit of stamps other than nanoseconds.
  std::optional<Unit> unit_of(const RecordedStream& stream, const RecordedStream* other) const {
    constexpr double kSameEpoch = 1.02;
    constexpr double kSameRate = 3;
    for (const Unit& unit : kUnits) {
      const double step_s = static_cast<double>(stream.step.count()) * unit.ns * 1e-9;
      if (stream.rate_hz > 0 && similar(step_s, 1 / stream.rate_hz, kSameRate)) return unit;
      if (other != nullptr && similar(static_cast<double>(to_ns(stream.first)) * unit.ns,
                                      static_cast<double>(to_ns(other->first)), kSameEpoch))
        return unit;
    }
    return std::nullopt;
  }

  /// A recording of corners needs no detector, one of images does.
  void judge_family() {
    const std::string& family = setup_.tags.family;
    if (is_tag_family(family)) return;
    bool any_images = false;
    for (std::size_t k = 0; k < info_.cameras.size(); ++k) any_images = any_images || has_images(k);
    find(any_images, "mav0/tags.yaml: family = " + family + ": " + tag_family_rule(family));
  }

  void judge_imu_file() {
    if (imu_) {
      const RecordedStream& imu = report_.streams[*imu_];
      if (imu.stamps == 0)
        find(true,
             empty_text(imu,
                        "reading (was there no IMU: remove the folder imu0, else record again)"));
    } else if (is_file(layout_.imu_yaml())) {
      find(
          true,
          "mav0/imu0/data.csv is missing, but mav0/imu0/sensor.yaml describes an IMU: copy it too, "
          "or remove the folder imu0");
    }
  }

  void judge_images() {
    std::size_t images = 0;
    for (const std::size_t i : cameras_) {
      const RecordedStream& camera = report_.streams[i];
      images += camera.stamps;
      if (camera.stamps == 0) find(false, empty_text(camera, "line"));
      if (camera.stamps == 0 || imu_) continue;
      if (const auto unit = unit_of(camera, nullptr))
        find(true, wrong_unit_text(camera, unit->name));
    }
    if (images == 0) find(true, "has neither images nor detections");
  }

  void judge_order() {
    for (const RecordedStream& stream : report_.streams) {
      const double left_out = static_cast<double>(stream.left_out);
      if (left_out <= kTooManyLeftOut * static_cast<double>(stream.stamps)) continue;
      find(true,
           stream.file + ": time goes back in most of its lines: sort it by its first column");
    }
  }

  void judge_clocks() {
    if (!imu_ || report_.streams[*imu_].stamps == 0) return;
    std::optional<Instant> first;
    std::optional<Instant> last;
    const RecordedStream* camera = nullptr;
    for (const std::size_t i : cameras_) {
      const RecordedStream& stream = report_.streams[i];
      if (stream.stamps == 0) continue;
      if (camera == nullptr) camera = &stream;
      first = std::min(first.value_or(stream.first), stream.first);
      last = std::max(last.value_or(stream.last), stream.last);
    }
    if (camera == nullptr) return;
    const RecordedStream& imu = report_.streams[*imu_];
    if (imu.last >= *first && imu.first <= *last) return judge_common_time(imu, *first, *last);
    if (const auto unit = unit_of(imu, camera)) return find(true, wrong_unit_text(imu, unit->name));
    if (const auto unit = unit_of(*camera, &imu))
      return find(true, wrong_unit_text(*camera, unit->name));
    const Duration apart = imu.first > *last ? imu.first - *last : *first - imu.last;
    const std::string which = imu.first > *last ? " begins " : " ends ";
    const std::string when = imu.first > *last ? " s after" : " s before";
    find(true,
         "IMU and images have no instant in common (" + imu.file + which +
             fixed(to_seconds(apart), 1) + when +
             " the images): their stamps are of different clocks, or of different recordings");
  }

  void judge_common_time(const RecordedStream& imu, Instant first, Instant last) {
    const double late_s = to_seconds(imu.first - first);
    const double early_s = to_seconds(last - imu.last);
    if (late_s <= kTogether_s && early_s <= kTogether_s) return;
    const double whole_s = to_seconds(last - first);
    const double covered = 1 - (std::max(late_s, 0.0) + std::max(early_s, 0.0)) / whole_s;
    std::string text = imu.file + ": ";
    if (late_s > kTogether_s) text += "begins " + fixed(late_s, 1) + " s after the images";
    if (late_s > kTogether_s && early_s > kTogether_s) text += ", and ";
    if (early_s > kTogether_s) text += "ends " + fixed(early_s, 1) + " s before the images";
    const bool shifted = late_s * early_s < 0 && similar(std::abs(late_s), std::abs(early_s), 1.2);
    find(covered < kLeastCovered,
         text + (shifted
                     ? ", and is too long by as much at the other end: its clock is probably "
                       "another one, set timeshift_cam_imu in the cameras' sensor.yaml"
                     : ": is it incomplete? Images are used without it there, poses between them "
                       "are guesses"));
  }

  void judge_readings() {
    for (const ImuFault fault : faults_)
      find(is_fatal(fault), "mav0/imu0/data.csv: " + std::string(text_of(fault)));
  }

  void judge_corners() {
    if (mirrored_ == 0) return;
    const std::string text = "the corners of " + std::to_string(mirrored_) + " of " +
                             std::to_string(sightings_) + " sightings run clockwise";
    if (2 * mirrored_ > sightings_)
      find(true, text +
                     ": the images are mirrored, or the order is not bottom-left, bottom-right, "
                     "top-right, top-left of the printed tag");
    else
      find(false, text + ": these are not used");
  }

  void find(bool unusable, std::string text) {
    report_.findings.push_back({unusable, std::move(text)});
  }
  [[nodiscard]] bool has_images(std::size_t k) const {
    return k < info_.has_images.size() && info_.has_images[k];
  }
  [[nodiscard]] bool has_corners(std::size_t k) const {
    return k < info_.has_corners.size() && info_.has_corners[k];
  }

  const RecordingInfo& info_;
  RecordingLayout layout_;
  OfflineSetup setup_;
  RecordingReport report_;
  std::optional<std::size_t> imu_;    ///< In `report_.streams`.
  std::vector<std::size_t> cameras_;  ///< In `report_.streams`, those with the times of images.
  ImuPlausibility plausibility_;
  RotationAgreement agreement_{setup_.sensors, setup_.estimator.corner_noise_px};
  ImuFaults imu_faults_{};        ///< Present ones.
  std::vector<ImuFault> faults_;  ///< All.
  TagObservations seen_;
  std::size_t sightings_{0};
  std::size_t mirrored_{0};
};

}  // namespace

bool RecordingReport::is_usable() const {
  return std::ranges::none_of(findings,
                              [](const RecordingFinding& finding) { return finding.unusable; });
}

Expected<RecordingReport> check_recording(const RecordingInfo& info) {
  auto layout = RecordingLayout::find(info.folder);
  if (!layout) return tl::unexpected(layout.error());
  return RecordingChecker(info, std::move(*layout)).check();
}

}  // namespace fiducap
