#include "estimation/starloc.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "capture/recording/csv_reader.hpp"

namespace fiducap::bench {
namespace {

/// All rows of `count` numbers; heading and damaged rows are left out.
Expected<std::vector<std::vector<double>>> read_rows(const std::filesystem::path& path,
                                                     std::size_t count) {
  auto reader = CsvReader::open(path);
  if (!reader) return tl::unexpected(reader.error());
  std::vector<std::vector<double>> rows;
  while (reader->next()) {
    std::vector<double> row(count);
    if (parse(reader->fields(), row)) rows.push_back(std::move(row));
  }
  return rows;
}

Expected<void> read_calibration(const std::filesystem::path& path, StarlocRun& run) {
  std::ifstream file(path);
  const auto json = nlohmann::json::parse(file, nullptr, false);
  if (json.is_discarded() || !json.contains("published_global"))
    return fail(ErrorCode::kInvalid, "is no calibration of STAR-loc", path.string());
  run.camera = {1920, 1080, json["fu"], json["fv"], json["cu"], json["cv"], Distortion::kNone, {}};
  run.baseline_m = json["baseline"];
  const auto q = json["published_global"]["q_cam_rig_xyzw"].get<std::array<double, 4>>();
  const auto p = json["published_global"]["p_cam_in_rig"].get<std::array<double, 3>>();
  const Eigen::Quaterniond q_VR(q[3], q[0], q[1], q[2]);
  run.X_RV = {q_VR.conjugate().normalized(), {p[0], p[1], p[2]}};
  return {};
}

void add_truth(const std::vector<double>& r, StarlocRun& run) {
  if (r[8] != 0) return;  // a glitch
  const Pose X_WR{Eigen::Quaterniond(r[4], r[5], r[6], r[7]).normalized(), {r[1], r[2], r[3]}};
  if (run.truth.empty() || r[0] > run.truth.back().t_s) run.truth.push_back({r[0], X_WR});
}

}  // namespace

std::optional<Pose> StarlocRun::rig_at(double t_s, double hole_s) const {
  const auto after = std::lower_bound(truth.begin(), truth.end(), t_s,
                                      [](const Place& p, double t) { return p.t_s < t; });
  if (after == truth.begin() || after == truth.end()) return std::nullopt;
  const Place& a = *(after - 1);
  const Place& b = *after;
  if (b.t_s - a.t_s > hole_s) return std::nullopt;
  const double s = (t_s - a.t_s) / (b.t_s - a.t_s);
  return Pose{a.X_WR.q.slerp(s, b.X_WR.q).normalized(), (1 - s) * a.X_WR.p + s * b.X_WR.p};
}

Expected<StarlocRun> read_starloc(const std::string& folder) {
  const std::filesystem::path path(folder);
  StarlocRun run;
  run.name = path.filename().string();
  if (const auto read = read_calibration(path / "calib.json", run); !read)
    return tl::unexpected(read.error());
  const auto map = read_rows(path / "map.csv", 4);
  const auto centres = read_rows(path / "stereo_centers.csv", 6);
  const auto truth = read_rows(path / "groundtruth.csv", 9);
  for (const auto* rows : {&map, &centres, &truth})
    if (!*rows) return tl::unexpected(rows->error());
  for (const auto& r : *map) run.tags[static_cast<int>(r[0])] = {r[1], r[2], r[3]};
  for (const auto& r : *centres)
    run.centres.push_back({r[0], static_cast<int>(r[1]), {r[2], r[3]}, {r[4], r[5]}});
  for (const auto& r : *truth) add_truth(r, run);
  if (const auto imu = read_rows(path / "imu.csv", 7))
    for (const auto& r : *imu)
      if (run.imu.empty() || r[0] > run.imu.back().t_s)
        run.imu.push_back({r[0], {r[1], r[2], r[3]}, {r[4], r[5], r[6]}});
  return run;
}

}  // namespace fiducap::bench
