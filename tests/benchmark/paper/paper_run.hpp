#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "estimation/options.hpp"
#include "simulation/corner_scatter.hpp"
#include "simulation/filter_run.hpp"
#include "tools/plot/plot_page.hpp"

namespace fiducap::bench {

/// One filter over one rendered sequence.
struct PaperRun {
  /// Estimate after an image, and the truth, both in the filter's workspace.
  struct At {
    double t_s{};
    Pose X_WB;
    Pose X_WB_true;
    Eigen::Vector3d v_B{Eigen::Vector3d::Zero()};  ///< m/s, body axes
    Eigen::Vector3d w_B{Eigen::Vector3d::Zero()};  ///< rad/s
    Eigen::Vector3d v_B_true{Eigen::Vector3d::Zero()};
    Eigen::Vector3d w_B_true{Eigen::Vector3d::Zero()};
    Pose X_BV;                                 ///< As estimated.
    int tags{};                                ///< In the image.
    std::vector<std::pair<int, Pose>> X_WT{};  ///< Tags in the state.

    [[nodiscard]] const Pose* tag(int tag_id) const;
  };
  EstimationData data;
  FilterRun run;
  std::vector<At> at;
  CornerScatter corners;  ///< Of all runs.
  BoundRun bound;         ///< For corners with this scatter …
  BoundRun white_bound;   ///< … and if their errors were white and equal.

  [[nodiscard]] double share_without_tag() const;
  /// Tags that exist and were seen at least once.
  [[nodiscard]] int tags_seen() const;
  /// RMSE of the position in the reference tag's axes after kSettled_s, by the bound's.
  [[nodiscard]] double position_by(const BoundRun& of) const;
  [[nodiscard]] double extrinsics_position_m(const At& moment) const;
  [[nodiscard]] double extrinsics_rotation_rad(const At& moment) const;
};

/// Options of the command line.
struct PaperOptions {
  std::vector<std::string> filters{"robocentric", "world"};
  int runs{10};
  std::uint64_t first_seed{1};
  int threads{2};
  bool quick{false};  ///< One short run each: enough to see that it works.
  EstimatorConfig estimator{};

  [[nodiscard]] int repeats() const { return quick ? 1 : runs; }
  [[nodiscard]] double seconds(double full, double quick_s) const { return quick ? quick_s : full; }
};

/// runs[seed][filter]
using PaperRuns = std::vector<std::vector<PaperRun>>;

/// Renders, detects and filters; each filter leads its own detector.
/// @param setup  `seed` and `images_for` are set here
[[nodiscard]] PaperRuns run_all(const PaperOptions& options, const SimulatedDataSetup& setup);

/// One number per run, over the runs of one filter.
struct Spread {
  double rms{};
  double worst{};
};
[[nodiscard]] Spread spread(const PaperRuns& runs, std::size_t filter,
                            const std::function<double(const PaperRun&)>& of);

/// A line of the table.
struct PaperFigure {
  std::string what;
  std::string unit;
  std::string paper;           ///< In the paper.
  std::string authors;         ///< Of the authors' code on our data (study of the code).
  std::vector<Spread> ours{};  ///< One per filter.
  int decimals{1};
  double goal{0};  ///< Of the RMS over the runs; 0: none.
};

struct PaperResult {
  std::string experiment;
  std::vector<PaperFigure> figures{};
  std::vector<LinePlot> plots{};
  std::vector<std::string> remarks{};
};

/// Adds a line with one number per filter.
void add_figure(PaperResult& result, PaperFigure line, const PaperRuns& runs,
                const std::function<double(const PaperRun&)>& of);

/// Adds lines about the consistency of the filter's sigmas: 1 is right, less is conservative.
void add_consistency(PaperResult& result, const PaperRuns& runs);

/// Colours of the plots.
inline constexpr const char* kTruthColor = "#9aa0a6";
[[nodiscard]] const char* color_of(const std::string& filter);

/// The paper's three tags on a table: errors of tags and motion.
[[nodiscard]] PaperResult table_experiment(const PaperOptions& options);
/// Three tags in a room of 4 m, fast, a fifth of the images without any; also velocity and body
/// rate against differences of a motion capture system's poses.
[[nodiscard]] PaperResult dataset_1_experiment(const PaperOptions& options);
/// 36 tags on a round trip of 70 m.
[[nodiscard]] PaperResult cube_experiment(const PaperOptions& options);
/// 33 tags on 80 m, half of it in daylight.
[[nodiscard]] PaperResult pavillon_experiment(const PaperOptions& options);
/// The simulator's hall: not the paper's, but many tags at once.
[[nodiscard]] PaperResult hall_experiment(const PaperOptions& options);
/// Camera extrinsics from a poor start, by the running filter and by `fiducap calibrate
/// extrinsics`.
[[nodiscard]] PaperResult extrinsics_experiment(const PaperOptions& options);

}  // namespace fiducap::bench
