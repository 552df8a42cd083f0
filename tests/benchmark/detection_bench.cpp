// fiducap_bench detection: tracking regions against libapriltag over whole images. Rendering is not
// measured. CPU time of this thread, which rises by a half on a busy machine, for all equally.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <random>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "base/process.hpp"
#include "bench.hpp"
#include "detection/image_measures.hpp"
#include "detection/observe.hpp"
#include "pipeline/body_pipeline.hpp"
#include "simulation/room_shape.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::bench {
namespace {

struct TrackingRunSetup {
  std::string room;
  int width{};
  int height{};
  int images{};
};

/// One way to find the tags of the same images.
struct SearchArm {
  std::string name;
  std::vector<double> cpu_us{};  ///< One per image, thread CPU time.
  int found{};                   ///< Of the tags that are truly in view …
  int in_view{};
  int found_of_reference{};  ///< … and of those that the reference found.
  int reference{};
  int gross{};           ///< Found, but a corner more than a pixel off.
  double squares_px2{};  ///< Of the others.
  int coordinates{};
  /// Of images that were searched whole, after the start; −1: does not apply.
  double whole_share{-1};

  [[nodiscard]] double mean_us() const {
    return std::accumulate(cpu_us.begin(), cpu_us.end(), 0.0) /
           static_cast<double>(std::max<std::size_t>(1, cpu_us.size()));
  }
  [[nodiscard]] double rms_px() const {
    return coordinates == 0 ? 0 : std::sqrt(squares_px2 / coordinates);
  }
};

/// 79° wide with a barrel lens at any resolution, looking along body x.
CameraMount barrel_camera(int width, int height) {
  const double f = 460.0 * width / 752;
  CameraMount mount;
  mount.model = {width, height, f, f, 0.5 * (width - 1), 0.5 * (height - 1)};
  mount.model.distortion = Distortion::kRadialTangential;
  mount.model.coefficients = {-0.28, 0.07, 2e-4, 2e-5, 0};
  mount.X_BV = simulation::forward_camera();
  return mount;
}

constexpr Duration kStart = std::chrono::seconds(1);
constexpr double kGross_px = 1.0;
constexpr unsigned kSeed = 1;
constexpr double kPredictedOff_m = 0.005;
constexpr double kPredictedOff_rad = 0.0052;

/// Renders a robot's flight (camera 20 Hz with a lens, IMU 200 Hz). Every image is searched by
///  0 libapriltag over the whole image, decimate 1, with its defaults: the reference,
///  1 the same with the contrast threshold from the measured noise,
///  2 libapriltag over the whole image, decimate 2,
///  3 TagSearch with predictions from the truth of the image before at its velocity, 5 mm and 0.3°
///  off, 4 GuidedSearch behind the world filter, which starts without a map.
/// The first second is not counted: nothing is tracked yet.
class TrackingRun final {
 public:
  explicit TrackingRun(const TrackingRunSetup& setup)
      : setup_(setup),
        mount_(barrel_camera(setup.width, setup.height)),
        tags_(simulation::tags_of(room())),
        arms_{{"libapriltag, decimate 1"},
              {"  with adapted contrast"},
              {"libapriltag, decimate 2"},
              {"ours, truth of last image"},
              {"ours, world filter"}},
        detector_({}, with_defaults()),
        search_({}, {}),
        random_(kSeed) {
    sensors_.cameras = {mount_};
    sensors_.imu = simulation::ImuErrors{}.noise;
    for (const RecordedTag& tag : tags_) print_.sizes_m[tag.tag_id] = tag.edge_m;
    PipelineSetup ours;
    ours.sensors = sensors_;
    ours.tags = print_;
    pipeline_.emplace(std::move(ours));
  }

  std::vector<SearchArm> run() {
    simulation::SimulatedBodyConfig body;
    body.cameras = {mount_};
    body.trajectory.kind = setup_.room == "hall" ? "survey" : setup_.room;
    body.trajectory.duration_s = to_seconds(kStart) + setup_.images / mount_.rate_hz;
    body.trajectory.seed = body.seed = kSeed;
    const auto source =
        simulation::make_simulated_source(room(), body, instant_from_ns(0), nullptr);
    if (!source) return {};
    for (bool more = true; more;) {
      auto next = (*source)->next({});
      more = next && next->has_value();
      if (more) {
        (void)pipeline_->push(std::move(**next));
      } else {
        pipeline_->finish();
      }
      while (pipeline_->next() != nullptr) take_next(**source);
    }
    finish();
    return arms_;
  }

 private:
  static DetectorConfig with_defaults() {
    DetectorConfig config;
    config.fit_sides = false;
    return config;
  }
  simulation::RoomConfig room() const {
    simulation::RoomConfig room;
    room.preset = setup_.room;
    return room;
  }

  void take_next(const simulation::SimulatedSource& source) {
    if (pipeline_->next_is_image()) {
      const auto& image = std::get<CameraFrame>(*pipeline_->next());
      if (!counting_ && image.exposed_at - instant_from_ns(0) >= kStart) {
        counting_ = true;
        search_before_ = search_.statistics();
        guided_before_ = pipeline_->statistics().search;
      }
      find_truth(source.truth(image.exposed_at).X_WB, in_view_);
      search_everywhere(image);
      search_where_predicted(image, source);
    }
    const Duration before = pipeline_->statistics().detect_cpu;
    const BodyUpdate* update = pipeline_->take(empty_);
    if (update == nullptr || !counting_) return;
    score(arms_[4], 1e6 * to_seconds(pipeline_->statistics().detect_cpu - before), update->corners);
  }

  template <typename Search>
  void measure(std::size_t arm, Search&& search) {
    const Duration begin = thread_cpu_time();
    const CornerFrame& found = search();
    const double us = 1e6 * to_seconds(thread_cpu_time() - begin);
    if (counting_) score(arms_[arm], us, found);
    if (arm == 0) reference_ = found;
  }

  void search_everywhere(const CameraFrame& image) {
    const auto pass = [&](double decimate, bool adapt) -> const CornerFrame& {
      found_.tags.clear();
      const int contrast = adapt ? contrast_above(pixel_noise(*image.image).value_or(0), {}) : 5;
      detector_.detect(*image.image, whole(*image.image), {decimate, contrast}, found_.tags);
      return found_;
    };
    measure(0, [&]() -> const CornerFrame& { return pass(1, false); });
    measure(1, [&]() -> const CornerFrame& { return pass(1, true); });
    measure(2, [&]() -> const CornerFrame& { return pass(2, false); });
  }

  void search_where_predicted(const CameraFrame& image, const simulation::SimulatedSource& source) {
    std::vector<ExpectedTag> expected;
    if (last_at_) {
      constexpr Duration kStep = std::chrono::milliseconds(1);
      const TruthSample now = source.truth(*last_at_);
      const Eigen::Vector3d rate =
          log_so3(source.truth(*last_at_ - kStep).X_WB.q.conjugate() * now.X_WB.q) /
          to_seconds(kStep);
      const double dt = to_seconds(image.exposed_at - *last_at_);
      Pose X_WB{(now.X_WB.q * exp_so3(rate * dt + off(kPredictedOff_rad))).normalized(),
                now.X_WB.p + now.v_WB * dt + off(kPredictedOff_m)};
      find_truth(X_WB, expected);
    }
    last_at_ = image.exposed_at;
    measure(3, [&]() -> const CornerFrame& { return search_.search(image, expected); });
  }

  /// Tags with bits of at least a pixel, well inside and seen from at most 80°, with the
  /// uncertainty of the prediction.
  void find_truth(const Pose& X_WB, std::vector<ExpectedTag>& out) const {
    out.clear();
    const Pose X_VW = (X_WB * mount_.X_BV).inverse();
    for (const RecordedTag& tag : tags_) {
      const Eigen::Vector3d p = X_VW * tag.X_WT.p;
      const Eigen::Vector3d normal = X_VW.q * (tag.X_WT.q * Eigen::Vector3d::UnitZ());
      if (p.z() < 0.05 || -normal.dot(p) < 0.17 * p.norm()) continue;
      const double sigma =
          1 + mount_.model.fu * std::hypot(kPredictedOff_m / p.z(), kPredictedOff_rad);
      ExpectedTag expected{tag.tag_id, {}, sigma};
      const auto corners = simulation::corners_of(tag);
      bool inside = true;
      double doubled_area = 0;
      double longest = 0;
      for (std::size_t i = 0; i < 4 && inside; ++i) {
        const auto px = mount_.model.project(X_VW * corners[i]);
        constexpr double kBorder_px = 8;
        inside = px && px->x() > kBorder_px && px->y() > kBorder_px &&
                 px->x() < mount_.model.width - 1 - kBorder_px &&
                 px->y() < mount_.model.height - 1 - kBorder_px;
        if (inside) expected.corners_px[i] = *px;
      }
      for (std::size_t i = 0; i < 4; ++i) {
        const Eigen::Vector2d& a = expected.corners_px[i];
        const Eigen::Vector2d& b = expected.corners_px[(i + 1) % 4];
        doubled_area += a.x() * b.y() - b.x() * a.y();
        longest = std::max(longest, (b - a).norm());
      }
      if (inside && 0.5 * std::abs(doubled_area) > 10 * longest) out.push_back(expected);
    }
  }

  void score(SearchArm& arm, double us, const CornerFrame& frame) {
    arm.cpu_us.push_back(us);
    const auto has = [](const CornerFrame& in, int id) {
      return std::any_of(in.tags.begin(), in.tags.end(),
                         [&](const TagSighting& t) { return t.tag_id == id; });
    };
    const CornerFrame& reference = &arm == arms_.data() ? frame : reference_;
    for (const TagSighting& tag : reference.tags) {
      ++arm.reference;
      arm.found_of_reference += has(frame, tag.tag_id) ? 1 : 0;
    }
    for (const ExpectedTag& truth : in_view_) {
      ++arm.in_view;
      const auto tag = std::find_if(frame.tags.begin(), frame.tags.end(),
                                    [&](const TagSighting& t) { return t.tag_id == truth.tag_id; });
      if (tag == frame.tags.end()) continue;
      ++arm.found;
      add_errors(arm, unbend_corners(mount_.model, tag->corners_px), truth.corners_px);
    }
  }

  static void add_errors(SearchArm& arm, const std::array<Eigen::Vector2d, 4>& found,
                         const std::array<Eigen::Vector2d, 4>& truth) {
    double squares = 0;
    double worst = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      squares += (found[i] - truth[i]).squaredNorm();
      worst = std::max(worst, (found[i] - truth[i]).cwiseAbs().maxCoeff());
    }
    if (worst > kGross_px) {
      ++arm.gross;
      return;
    }
    arm.squares_px2 += squares;
    arm.coordinates += 8;
  }

  void finish() {
    const auto share = [](const SearchStatistics& now, const SearchStatistics& before) {
      return static_cast<double>(now.whole_images - before.whole_images) /
             static_cast<double>(std::max<std::uint64_t>(1, now.images - before.images));
    };
    arms_[3].whole_share = share(search_.statistics(), search_before_);
    arms_[4].whole_share = share(pipeline_->statistics().search, guided_before_);
  }

  Eigen::Vector3d off(double sigma) {
    const double x = normal_(random_);
    const double y = normal_(random_);
    return sigma * Eigen::Vector3d(x, y, normal_(random_));
  }

  TrackingRunSetup setup_;
  CameraMount mount_;
  std::vector<RecordedTag> tags_;
  std::vector<SearchArm> arms_;
  TagDetector detector_;
  TagSearch search_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  BodySensors sensors_;
  TagSetConfig print_;
  std::optional<BodyPipeline> pipeline_;
  MapView empty_{std::make_shared<const TagMap>()};
  std::vector<ExpectedTag> in_view_;
  CornerFrame found_;
  CornerFrame reference_;
  SearchStatistics search_before_;
  SearchStatistics guided_before_;
  std::optional<Instant> last_at_;
  bool counting_{false};
};

void print_tracking(const TrackingRunSetup& setup) {
  const std::vector<SearchArm> arms = TrackingRun(setup).run();
  if (arms.empty()) return;
  std::printf("\n%d x %d, %s: %d images, %.1f tags in view\n", setup.width, setup.height,
              setup.room.c_str(), setup.images,
              static_cast<double>(arms[0].in_view) / setup.images);
  std::printf("  %-28s %9s %9s %9s %8s %9s %9s %9s %6s %7s\n", "", "mean ms", "p50 ms", "p99 ms",
              "ratio", "recall", "of ref.", "rms px", "> 1 px", "whole");
  for (const SearchArm& arm : arms) {
    std::printf(
        "  %-28s %9.2f %9.2f %9.2f %8.1f %8.2f%% %8.2f%% %9.4f %6d ", arm.name.c_str(),
        1e-3 * arm.mean_us(), 1e-3 * quantile(arm.cpu_us, 0.5), 1e-3 * quantile(arm.cpu_us, 0.99),
        arms[0].mean_us() / arm.mean_us(), 100.0 * arm.found / std::max(1, arm.in_view),
        100.0 * arm.found_of_reference / std::max(1, arm.reference), arm.rms_px(), arm.gross);
    if (arm.whole_share >= 0) {
      std::printf("%6.1f%%\n", 100 * arm.whole_share);
    } else {
      std::printf("%7s\n", "-");
    }
  }
}

}  // namespace

Bench add_detection(CLI::App&, const bool& quick) {
  return [&quick] {
    const auto images = [&](int full) { return quick ? std::max(10, full / 20) : full; };
    for (const char* room : {"hall", "table", "sparse", "loop", "ceiling"})
      print_tracking({room, 752, 480, images(200)});
    for (const char* room : {"hall", "ceiling"}) {
      print_tracking({room, 1280, 720, images(100)});
      print_tracking({room, 1920, 1080, images(60)});
    }
    return 0;
  };
}

}  // namespace fiducap::bench
