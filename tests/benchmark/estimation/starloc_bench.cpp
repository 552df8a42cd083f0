// The STAR-loc recordings: their clocks, and the filters with tag centres.
#include "estimation/options.hpp"
#include "estimation/starloc.hpp"

namespace fiducap::bench {
namespace {

constexpr const char* kRuns[]{"loop-2d_s1", "loop-2d-fast_s3", "apriltag_s3", "zigzag_s3"};
constexpr double kMs = 1e3;

std::vector<Table> empty_tables() {
  return {
      {"STAR-loc, camera's clock against Vicon's (t_vicon = t_camera + offset, middle of the run), "
       "by "
       "all tag centres",
       split("run|images|period ms|longest gap s|offset ms|±|scatter of 10 s windows|drift ms/s|± |"
             "median px")},
      {"STAR-loc, IMU's clock against Vicon's (t_vicon = t_imu + offset), by body rates over 50 ms",
       split("run|period ms|lost %|longest gap ms|offset ms|scatter of 10 s windows|drift ms/s|"
             "left rad/s")},
      {"STAR-loc, filters with known tag centres against Vicon (first 2 s helped, not scored)",
       split("run|filter|IMU|stamps|images|with pose|median mm|RMSE mm|95 % mm|worst mm|at s|deg|"
             "in 95 % ellipsoid|starts|helped|used|rejected|PnP median mm|of")}};
}

void add_tracking(const StarlocRun& run, const CameraClock& camera, const ImuClock* imu,
                  const StarlocChoice& choice, Table& table) {
  const StarlocTracking t = track(run, camera, imu, choice);
  const bool inertial = imu != nullptr && choice.use_imu;
  const auto count = [](int n) { return Figure{static_cast<double>(n), 0}; };
  table.rows.push_back(cells(run.name, choice.filter, std::string(inertial ? "yes" : "no"),
                             std::string(choice.corrected_clocks ? "corrected" : "as recorded"),
                             count(t.images), count(t.with_pose), Figure{kMm * t.median_m, 0},
                             Figure{kMm * t.rmse_m, 0}, Figure{kMm * t.p95_m, 0},
                             Figure{kMm * t.worst_m, 0}, Figure{t.worst_at_s, 1},
                             Figure{kDegreesPerRadian * t.rmse_rad, 2}, Figure{t.covered, 2},
                             count(t.starts), count(t.helped), count(t.used), count(t.rejected),
                             Figure{kMm * t.pnp_median_m, 0}, count(t.pnp_images)));
}

}  // namespace

std::vector<Table> bench_starloc(const EstimationOptions& options) {
  std::vector<Table> tables = empty_tables();
  for (const char* name : kRuns) {
    const auto run = read_starloc(options.data + "/starloc/" + name);
    if (!run) {
      tables.front().remarks.push_back(run.error().text());
      continue;
    }
    const CameraClock camera = measure_camera_clock(*run);
    tables[0].rows.push_back(
        cells(run->name, Figure{static_cast<double>(camera.images), 0},
              Figure{kMs * camera.period_median_s, 1}, Figure{camera.longest_gap_s, 2},
              Figure{kMs * camera.offset_s, 1}, Figure{kMs * camera.offset_sigma_s, 1},
              Figure{kMs * camera.window_scatter_s, 1}, Figure{kMs * camera.drift, 3},
              Figure{kMs * camera.drift_sigma, 3}, Figure{camera.reprojection_median_px, 2}));
    std::optional<ImuClock> imu;
    if (!run->imu.empty()) {
      imu = measure_imu_clock(*run);
      tables[1].rows.push_back(
          cells(run->name, Figure{kMs * imu->period_median_s, 2}, Figure{100 * imu->lost_share, 1},
                Figure{kMs * imu->longest_gap_s, 0}, Figure{kMs * imu->offset_s, 1},
                Figure{kMs * imu->window_scatter_s, 1}, Figure{kMs * imu->drift, 3},
                Figure{imu->rate_rms_rad_s, 3}));
    }
    for (const std::string& filter : options.filters) {
      const bool needs_imu = filter == "robocentric";
      if (needs_imu && !imu) continue;
      StarlocChoice choice;
      choice.filter = filter;
      add_tracking(*run, camera, imu ? &*imu : nullptr, choice, tables[2]);
      if (!imu) continue;
      choice.corrected_clocks = false;
      add_tracking(*run, camera, &*imu, choice, tables[2]);
      choice.corrected_clocks = true;
      choice.use_imu = false;
      if (!needs_imu) add_tracking(*run, camera, &*imu, choice, tables[2]);
    }
  }
  return tables;
}

}  // namespace fiducap::bench
