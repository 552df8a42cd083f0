#include "tools/replay/run_files.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>

#include <yaml-cpp/yaml.h>
#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include "mapping/formats/map_yaml.hpp"
#include "tools/whole_file.hpp"

namespace fiducap {
namespace {

// How far T_BS may be from a rotation: files carry nine decimals.
constexpr double kRotationTolerance = 1e-5;

std::string shortest(double value) {
  std::array<char, 40> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

nlohmann::ordered_json cpu_report(const OfflineStatistics& s) {
  const double total =
      s.read_cpu_s + s.detect_cpu_s + s.propagate_cpu_s + s.update_cpu_s + s.settle_cpu_s;
  const double filter = s.propagate_cpu_s + s.update_cpu_s;
  return {{"read", s.read_cpu_s},
          {"detect", s.detect_cpu_s},
          {"propagate", s.propagate_cpu_s},
          {"update", s.update_cpu_s},
          {"settle", s.settle_cpu_s},
          {"total", total},
          {"filter_per_second_of_data", s.data_s > 0 ? filter / s.data_s : 0.0}};
}

Expected<Pose> pose_from_matrix(const std::vector<double>& m, const std::string& name,
                                const std::string& context) {
  if (m.size() != 16)
    return fail(ErrorCode::kInvalid,
                name + ".T_BS.data must have 16 numbers, has " + std::to_string(m.size()), context);
  Eigen::Matrix3d R;
  R << m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10];
  const bool rigid = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <
                         kRotationTolerance &&
                     R.determinant() > 0;
  if (!rigid)
    return fail(ErrorCode::kInvalid, name + ".T_BS is no rotation with a translation", context);
  return Pose{Eigen::Quaterniond(R).normalized(), {m[3], m[7], m[11]}};
}

}  // namespace

TagMap run_map(const OfflineSetup& setup, const OfflineResult& result) {
  TagMap map;
  map.family = setup.tags.family;
  map.reference_tag = setup.gauge.reference_tag;
  for (const KnownTag& tag : result.known) map.tags.push_back({tag, TagState::kSurveyed});
  for (const TagBelief& belief : result.tags) {
    MapTag entry{belief.tag, TagState::kLocal};
    entry.first_seen_utc_ns = to_ns(belief.first_seen);
    entry.last_seen_utc_ns = to_ns(belief.last_seen);
    entry.sightings = belief.sightings;
    map.tags.push_back(entry);
  }
  std::stable_sort(map.tags.begin(), map.tags.end(),
                   [](const MapTag& a, const MapTag& b) { return a.tag.tag_id < b.tag.tag_id; });
  const auto same_id = [](const MapTag& a, const MapTag& b) {
    return a.tag.tag_id == b.tag.tag_id;
  };
  map.tags.erase(std::unique(map.tags.begin(), map.tags.end(), same_id), map.tags.end());
  return map;
}

std::string run_report(const std::string& body, const OfflineSetup& setup,
                       const OfflineResult& result) {
  const OfflineStatistics& s = result.statistics;
  const nlohmann::ordered_json report{
      {"body", body},
      {"filter", setup.filter},
      {"data_s", s.data_s},
      {"imu_samples", s.imu_samples},
      {"frames", s.frames},
      {"frames_with_tags", s.frames_with_tags},
      {"frames_with_pose", s.frames_with_pose},
      {"frames_with_tags_and_pose", s.frames_with_tags_and_pose},
      {"tags_known", result.known.size()},
      {"tags_mapped", result.tags.size()},
      {"cpu_s", cpu_report(s)},
      {"filter_statistics",
       {{"nis_per_dof", s.nis_per_dof()},
        {"nis_dof", s.nis_dof},
        {"tags_used", s.tags_used},
        {"tags_rejected", s.tags_rejected},
        {"reprojection_median_px", s.reprojection_median_px},
        {"reprojection_p95_px", s.reprojection_p95_px}}},
      {"doubts", result.doubts},
      {"dropped",
       {{"images_queue_full", s.merger.images_dropped},
        {"late", s.merger.late_dropped},
        {"backwards", s.merger.backwards_dropped},
        {"bad_numbers", s.merger.bad_dropped},
        {"images_without_closing_imu", s.merger.imu_waits_expired}}}};
  return report.dump(2) + "\n";
}

Expected<void> write_run_files(const std::string& folder, const std::string& body,
                               const OfflineSetup& setup, const OfflineResult& result) {
  const std::filesystem::path to(folder);
  std::vector<Pose> X_BV;
  for (const ExtrinsicsEstimate& camera : result.extrinsics) X_BV.push_back(camera.X_BV);
  std::vector<std::pair<std::string, std::string>> files{
      {body + ".tum", to_tum(result.trajectory)},
      {"map.csv", map_to_csv(run_map(setup, result))},
      {"extrinsics.yaml", to_extrinsics_yaml(X_BV)},
      {"report.json", run_report(body, setup, result)},
  };
  if (!result.live.empty()) files.emplace_back(body + ".live.tum", to_tum(result.live));
  for (const auto& [name, content] : files)
    if (auto written = write_whole_file((to / name).string(), content); !written) return written;
  return {};
}

std::string to_extrinsics_yaml(const std::vector<Pose>& X_BV) {
  std::string text = "# Sensor to body, as estimated at the end of the run.\n";
  for (std::size_t k = 0; k < X_BV.size(); ++k) {
    const Eigen::Matrix3d R = X_BV[k].rotation();
    text += "cam" + std::to_string(k) + ":\n  T_BS:\n    cols: 4\n    rows: 4\n    data: [";
    for (int row = 0; row < 3; ++row)
      text += shortest(R(row, 0)) + ", " + shortest(R(row, 1)) + ", " + shortest(R(row, 2)) + ", " +
              shortest(X_BV[k].p(row)) + ", ";
    text += "0, 0, 0, 1]\n";
  }
  return text;
}

Expected<std::vector<Pose>> extrinsics_from_yaml(const std::string& text, std::size_t cameras,
                                                 const std::string& context) {
  std::vector<Pose> X_BV;
  try {
    const YAML::Node root = YAML::Load(text);
    for (std::size_t k = 0; k < cameras; ++k) {
      const std::string name = "cam" + std::to_string(k);
      YAML::Node data = YAML::Clone(root);
      for (const char* key : {name.c_str(), "T_BS", "data"})
        data.reset(data.IsMap() ? data[key] : YAML::Node());
      if (!data.IsDefined() || !data.IsSequence())
        return fail(ErrorCode::kInvalid, "needs " + name + ": T_BS: data: [16 numbers]", context);
      const auto pose = pose_from_matrix(data.as<std::vector<double>>(), name, context);
      if (!pose) return tl::unexpected(pose.error());
      X_BV.push_back(*pose);
    }
  } catch (const YAML::Exception& problem) {
    return fail(ErrorCode::kInvalid, std::string("is no YAML: ") + problem.what(), context);
  }
  return X_BV;
}

}  // namespace fiducap
