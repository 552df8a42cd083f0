#include "tools/replay/run_files.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <tuple>

#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include "base/numeric.hpp"
#include "base/text.hpp"
#include "base/whole_file.hpp"
#include "base/yaml_section.hpp"
#include "capture/recording/recording.hpp"
#include "mapping/formats/map_format.hpp"

namespace fiducap {
namespace {

namespace fs = std::filesystem;

nlohmann::ordered_json cpu_report(const OfflineStatistics& s) {
  const double total =
      s.read_cpu_s + s.detect_cpu_s + s.propagate_cpu_s + s.update_cpu_s + s.resolve_cpu_s;
  const double filter = s.propagate_cpu_s + s.update_cpu_s;
  return {{"read", s.read_cpu_s},
          {"detect", s.detect_cpu_s},
          {"propagate", s.propagate_cpu_s},
          {"update", s.update_cpu_s},
          {"resolve", s.resolve_cpu_s},
          {"total", total},
          {"filter_per_second_of_data", s.data_s > 0 ? filter / s.data_s : 0.0}};
}

constexpr const char* kReport = "report.json";
constexpr const char* kPlots = "plots.html";

/// Whether a run may write a file of this name.
bool is_of_a_run(const fs::path& file) {
  const std::string name = file.filename().string();
  return name == "map.csv" || name == "events.csv" || name == kReport || name == kPlots ||
         name.ends_with("extrinsics.yaml") || name.ends_with(".tum") ||
         name.ends_with(".covariance.csv") || name.ends_with(".part.csv");
}

/// The files that report.json of an earlier run lists; nullopt: there is no such report.
std::optional<std::vector<std::string>> files_listed(const fs::path& folder) {
  const auto text = read_whole_file((folder / kReport).string());
  if (!text) return std::nullopt;
  const auto json = nlohmann::json::parse(*text, nullptr, false);
  if (!json.is_object() || !json.contains("files") || !json["files"].is_array())
    return std::nullopt;
  std::vector<std::string> files;
  for (const auto& file : json["files"])
    if (file.is_string()) files.push_back(file.get<std::string>());
  return files;
}

std::string event_line(Instant at, const std::string& body, std::string_view event, int tag_id,
                       const Pose& shift, std::string text) {
  std::replace(text.begin(), text.end(), ',', ';');
  const double turn_deg =
      2 * std::atan2(shift.q.vec().norm(), std::abs(shift.q.w())) * kDegreesPerRadian;
  return std::to_string(to_ns(at)) + "," + body + "," + std::string(event) + "," +
         (tag_id < 0 ? "" : std::to_string(tag_id)) + "," + shortest(shift.p.norm()) + "," +
         shortest(turn_deg) + "," + text + "\n";
}

std::string events_csv(std::span<const RunBody> bodies, const OfflineSession& session) {
  std::vector<std::pair<Instant, std::string>> lines;
  for (const RunBody& body : bodies)
    for (const BodyEvent& event : body.result->events)
      lines.emplace_back(event.at, event_line(event.at, body.name, name_of(event.kind),
                                              event.tag_id, event.shift, event.text));
  for (const auto& [at, event] : session.map_events) {
    const bool is_about_a_tag =
        event.kind != MapEvent::Kind::kPublished && event.kind != MapEvent::Kind::kWorkspace;
    lines.emplace_back(at, event_line(at, "", name_of(event.kind),
                                      is_about_a_tag ? event.tag_id : -1, {}, event.text));
  }
  std::ranges::stable_sort(lines, [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string text = "#t_ns,body,event,tag_id,shift_m,shift_deg,text\n";
  for (const auto& [at, line] : lines) text += line;
  return text;
}

/// True poses at the instants of the trajectory; empty: the recording has no truth.
std::string truth_tum(const std::string& recording, const OfflineResult& result) {
  if (recording.empty()) return {};
  const auto truth = read_truth(recording);
  if (!truth || truth->empty()) return {};
  std::vector<StampedPose> poses;
  for (const StampedPose& pose : result.trajectory)
    if (const auto X_WB = truth_at(*truth, pose.at)) poses.push_back({pose.at, *X_WB});
  return to_tum(poses);
}

using Files = std::vector<std::pair<std::string, std::string>>;

void add_body_files(const RunBody& body, bool alone, Files& files) {
  const OfflineResult& result = *body.result;
  std::vector<RunCamera> cameras;
  for (const ExtrinsicsEstimate& camera : result.extrinsics)
    cameras.push_back({camera.X_BV, camera.lens.offset});
  files.emplace_back(body.name + ".tum", to_tum(result.trajectory));
  files.emplace_back(body.name + ".covariance.csv", to_covariance_csv(result.covariances));
  files.emplace_back(alone ? "extrinsics.yaml" : body.name + ".extrinsics.yaml",
                     to_extrinsics_yaml(cameras));
  if (!result.live.empty()) files.emplace_back(body.name + ".live.tum", to_tum(result.live));
  for (std::size_t k = 0; k < result.parts.size(); ++k) {
    const std::string name = part_name(body.name, k);
    TagMap tags;
    tags.family = body.setup->tags.family;
    for (const KnownTag& tag : result.parts[k].tags) tags.tags.push_back({tag, TagState::kLocal});
    files.emplace_back(name + ".tum", to_tum(result.parts[k].trajectory));
    files.emplace_back(name + ".csv", map_to_csv(tags));
  }
  if (std::string truth = truth_tum(body.recording, result); !truth.empty())
    files.emplace_back(body.name + ".truth.tum", std::move(truth));
}

/// Tags and number of poses of each part.
nlohmann::ordered_json parts_report(const RunBody& body) {
  nlohmann::ordered_json parts = nlohmann::ordered_json::array();
  for (const OfflinePart& part : body.result->parts) {
    nlohmann::ordered_json ids = nlohmann::ordered_json::array();
    for (const KnownTag& tag : part.tags) ids.push_back(tag.tag_id);
    parts.push_back({{"file", part_name(body.name, parts.size()) + ".tum"},
                     {"poses", part.trajectory.size()},
                     {"tags", ids}});
  }
  return parts;
}

/// Number of events of each kind, by the names of events.csv.
nlohmann::ordered_json counts_of(const std::vector<BodyEvent>& events) {
  nlohmann::ordered_json counts = nlohmann::ordered_json::object();
  for (const auto kind : {BodyEvent::Kind::kReset, BodyEvent::Kind::kRelocalised,
                          BodyEvent::Kind::kMotionLost, BodyEvent::Kind::kImageRejected,
                          BodyEvent::Kind::kTagDropped, BodyEvent::Kind::kClockJumped})
    counts[std::string(name_of(kind))] = std::ranges::count_if(
        events, [kind](const BodyEvent& event) { return event.kind == kind; });
  return counts;
}

/// Messages to the user: estimated noises, lenses, sizes, clocks, with remedies.
nlohmann::ordered_json messages_in(const std::vector<BodyEvent>& events) {
  nlohmann::ordered_json messages = nlohmann::ordered_json::array();
  for (const BodyEvent& event : events) {
    if (!event.text.empty())
      messages.push_back(
          {{"t_ns", to_ns(event.at)}, {"event", name_of(event.kind)}, {"text", event.text}});
  }
  return messages;
}

nlohmann::ordered_json body_report(const RunBody& body) {
  const OfflineStatistics& s = body.result->statistics;
  return {{"body", body.name},
          {"filter", body.setup->filter},
          {"data_s", s.data_s},
          {"imu_samples", s.imu_samples},
          {"frames", s.frames},
          {"frames_with_tags", s.frames_with_tags},
          {"frames_with_pose", s.frames_with_pose},
          {"frames_with_tags_and_pose", s.frames_with_tags_and_pose},
          {"frames_before_anchoring", s.frames_before_anchoring},
          {"tags_known", body.result->known.size()},
          {"tags_mapped", body.result->tags.size()},
          {"cpu_s", cpu_report(s)},
          {"filter_statistics",
           {{"nis_per_dof", s.nis_per_dof()},
            {"nis_dof", s.nis_dof},
            {"tags_used", s.tags_used},
            {"tags_rejected", s.tags_rejected},
            {"reprojection_median_px", s.reprojection_median_px},
            {"reprojection_p95_px", s.reprojection_p95_px}}},
          {"doubts", body.result->doubts},
          {"parts", parts_report(body)},
          {"events", counts_of(body.result->events)},
          {"said", messages_in(body.result->events)},
          {"dropped",
           {{"images_queue_full", s.merger.images_dropped},
            {"late", s.merger.late_dropped},
            {"backwards", s.merger.backwards_dropped},
            {"far_ahead", s.merger.far_dropped},
            {"bad_numbers", s.merger.bad_dropped},
            {"images_without_closing_imu", s.merger.imu_waits_expired}}}};
}

nlohmann::ordered_json report_of(std::span<const RunBody> bodies, const OfflineSession& session) {
  nlohmann::ordered_json report;
  if (bodies.size() == 1) {
    report = body_report(bodies.front());
  } else {
    report["bodies"] = nlohmann::ordered_json::array();
    for (const RunBody& body : bodies) report["bodies"].push_back(body_report(body));
  }
  report["tags_in_map"] = session.map.tags.size();
  const LiveAgreement& live = session.agreement;
  if (live.compared + session.turns_missed > 0)
    report["live"] = {{"compared", live.compared},
                      {"different", live.different},
                      {"worst_m", live.worst_m},
                      {"worst_rad", live.worst_rad},
                      {"turns_missed", session.turns_missed}};
  return report;
}

}  // namespace

std::string part_name(const std::string& body, std::size_t part) {
  return body + "." + std::to_string(part + 1) + ".part";
}

TagMap run_map(std::span<const RunBody> bodies) {
  TagMap map;
  map.family = bodies.front().setup->tags.family;
  map.reference_tag = bodies.front().setup->gauge.reference_tag;
  for (const RunBody& body : bodies) {
    for (const KnownTag& tag : body.result->known) map.tags.push_back({tag, TagState::kSurveyed});
    for (const TagBelief& belief : body.result->tags) {
      MapTag entry{belief.tag, TagState::kLocal};
      entry.first_seen_utc_ns = to_ns(belief.first_seen);
      entry.last_seen_utc_ns = to_ns(belief.last_seen);
      entry.sightings = belief.sightings;
      map.tags.push_back(entry);
    }
  }
  const auto order = [](const MapTag& entry) {
    const double variance = entry.tag.covariance.diagonal().head<3>().sum();
    return std::tuple(entry.tag.tag_id, entry.state != TagState::kSurveyed, variance);
  };
  std::ranges::stable_sort(map.tags,
                           [&](const MapTag& a, const MapTag& b) { return order(a) < order(b); });
  const auto same_id = [](const MapTag& a, const MapTag& b) {
    return a.tag.tag_id == b.tag.tag_id;
  };
  map.tags.erase(std::unique(map.tags.begin(), map.tags.end(), same_id), map.tags.end());
  return map;
}

std::vector<TagPlace> places_in(const TagMap& map,
                                const std::function<bool(const MapTag&)>& is_wanted) {
  std::vector<TagPlace> places;
  for (const MapTag& entry : map.tags)
    if (is_wanted(entry)) places.push_back({entry.tag.tag_id, entry.tag.edge_m, entry.tag.X_WT});
  return places;
}

std::string no_pose_text(const OfflineResult& result, const OfflineSetup& setup) {
  const OfflineStatistics& s = result.statistics;
  const std::string images = std::to_string(s.frames) + " images, no pose: ";
  for (const BodyEvent& event : result.events)
    if (event.kind == BodyEvent::Kind::kImuUnusable || event.kind == BodyEvent::Kind::kImuSilent)
      return images + event.text;
  if (s.frames_with_tags == 0) {
    const std::string why = why_no_tag(result.few.images(), setup.tags, setup.detector);
    return images + "no tag was found in any of them" +
           (why.empty() ? ". Look at tags.family" : ": " + why);
  }
  if (s.tags_used == 0 && result.tags.empty())
    return images + "tags were found in " + std::to_string(s.frames_with_tags) +
           ", but none for long enough to be placed";
  return images +
         "no tag ties the body to the workspace. Is the reference tag (map.reference_tag) in view, "
         "or a tag of the map?";
}

std::string run_report(std::span<const RunBody> bodies, const OfflineSession& session) {
  return report_of(bodies, session).dump(2) + "\n";
}

Expected<void> check_run_folder(const std::string& folder) {
  std::error_code error;
  if (!fs::exists(folder, error)) return {};
  if (!fs::is_directory(folder, error)) return fail(ErrorCode::kInvalid, "is no folder", folder);
  if (files_listed(folder)) return {};
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (is_of_a_run(entry.path()))
      return fail(ErrorCode::kInvalid,
                  "is there, and no replay of this version has written it: what is beside it would "
                  "be mixed with this run. Choose another folder for --out, or remove it",
                  entry.path().string());
  }
  return {};
}

Expected<void> check_same_run(const std::string& tum) {
  const fs::path path(tum);
  const auto listed = files_listed(path.parent_path());
  const std::string name = path.filename().string();
  if (!listed || std::find(listed->begin(), listed->end(), name) != listed->end()) return {};
  return fail(ErrorCode::kInvalid,
              "map and extrinsics beside it belong to another run (" + std::string(kReport) +
                  " does not list it); replay again",
              tum);
}

Expected<void> write_run_files(const std::string& folder, std::span<const RunBody> bodies,
                               const OfflineSession& session, const std::string& plots) {
  const fs::path to(folder);
  if (const auto earlier = files_listed(to)) {
    std::error_code ignored;
    for (const std::string& name : *earlier)
      if (is_of_a_run(name) && fs::path(name).filename() == name) fs::remove(to / name, ignored);
  }
  Files files;
  for (const RunBody& body : bodies) add_body_files(body, bodies.size() == 1, files);
  files.emplace_back("map.csv", map_to_csv(run_map(bodies)));
  files.emplace_back("events.csv", events_csv(bodies, session));
  if (!plots.empty()) files.emplace_back(kPlots, plots);
  nlohmann::ordered_json report = report_of(bodies, session);
  report["files"] = nlohmann::ordered_json::array();
  for (const auto& [name, content] : files) report["files"].push_back(name);
  // The list comes first, so that a run that is cut off can still be replaced whole.
  files.emplace(files.begin(), kReport, report.dump(2) + "\n");
  for (const auto& [name, content] : files)
    if (auto written = write_whole_file((to / name).string(), content); !written) return written;
  return {};
}

std::string to_extrinsics_yaml(const std::vector<RunCamera>& cameras) {
  std::string text = "# Sensor to body, as estimated at the end of the run.\n";
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const Pose& X_BV = cameras[k].X_BV;
    const Eigen::Matrix3d R = X_BV.rotation();
    text += "cam" + std::to_string(k) + ":\n  T_BS:\n    cols: 4\n    rows: 4\n    data: [";
    for (int row = 0; row < 3; ++row)
      text += shortest(R(row, 0)) + ", " + shortest(R(row, 1)) + ", " + shortest(R(row, 2)) + ", " +
              shortest(X_BV.p(row)) + ", ";
    text += "0, 0, 0, 1]\n";
    const LensOffset& lens = cameras[k].lens;
    if (lens.is_none()) continue;
    text += "  # The lens beyond the recording's.\n  lens: {focal: " + shortest(lens.focal) +
            ", centre_px: [" + shortest(lens.centre_px.x()) + ", " + shortest(lens.centre_px.y()) +
            "], k1: " + shortest(lens.k1) + "}\n";
  }
  return text;
}

Expected<std::vector<RunCamera>> extrinsics_from_yaml(const std::string& text, std::size_t cameras,
                                                      const std::string& context) {
  const auto root = load_yaml(text);
  if (!root) return fail(ErrorCode::kInvalid, root.error().text(), context);
  const YamlSection file(*root, "", std::make_shared<YamlReading>(YamlReading{context}));
  std::vector<RunCamera> out;
  for (std::size_t k = 0; k < cameras; ++k) {
    const YamlSection camera = file.section("cam" + std::to_string(k));
    out.push_back({camera.required_pose("T_BS"), {}});
    if (!camera.has("lens")) continue;
    const YamlSection lens = camera.section("lens");
    const auto centre_px = lens.required_numbers("centre_px", 2);
    out.back().lens = {
        lens.required_number("focal"), {centre_px[0], centre_px[1]}, lens.required_number("k1")};
  }
  return file.check().map([&] { return std::move(out); });
}

}  // namespace fiducap
