#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/numeric.hpp"
#include "base/text.hpp"
#include "tools/replay/replay_verbs.hpp"
#include "tools/tags/map_files.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMostNamed = 20;

template <typename Range, typename Name>
std::string listed(const Range& range, Name name) {
  std::string text;
  std::size_t count = 0;
  for (const auto& one : range) {
    if (++count > kMostNamed)
      return text + " and " + std::to_string(range.size() - kMostNamed) + " more";
    text += (text.empty() ? "" : ", ") + name(one);
  }
  return text;
}

std::string tags_text(const std::vector<int>& ids) {
  return (ids.size() == 1 ? "tag " : "tags ") +
         listed(ids, [](int id) { return std::to_string(id); });
}

/// Of all tags that were placed; surveyed ones are as they were given.
struct Sigmas {
  std::vector<double> place_m;
  std::vector<double> attitude_rad;
  int worst_tag{};
  int worst_turned_tag{};
};

Sigmas sigmas_of(const TagMap& map) {
  Sigmas sigmas;
  double worst = 0;
  double worst_turned = 0;
  for (const MapTag& entry : map.tags) {
    if (entry.state == TagState::kSurveyed) continue;
    const auto [place, attitude] = largest_sigmas(entry.tag);
    sigmas.place_m.push_back(place);
    sigmas.attitude_rad.push_back(attitude);
    if (place >= worst) sigmas.worst_tag = entry.tag.tag_id;
    if (attitude >= worst_turned) sigmas.worst_turned_tag = entry.tag.tag_id;
    worst = std::max(worst, place);
    worst_turned = std::max(worst_turned, attitude);
  }
  return sigmas;
}

std::set<int> all_seen(const MapBuild& build) {
  std::set<int> seen;
  for (const BuiltRecording& recording : build.recordings)
    seen.insert(recording.seen.begin(), recording.seen.end());
  return seen;
}

/// Seen, but in no component of the graph.
std::vector<int> never_placed(const MapBuild& build) {
  std::set<int> left = all_seen(build);
  for (const MapTag& entry : build.map.tags) left.erase(entry.tag.tag_id);
  for (const auto& [tag_id, sightings] : build.seen_too_seldom) left.erase(tag_id);
  for (const MapPart& part : build.apart)
    for (const int tag_id : part.tag_ids) left.erase(tag_id);
  return {left.begin(), left.end()};
}

std::string why_nothing(const BuiltRecording& recording) {
  if (recording.images == 0) return "has neither images nor detections";
  if (recording.images_with_tags == 0)
    return "no tag was found in its " + std::to_string(recording.images) + " images: " +
           (recording.why_no_tag.empty() ? "is tags.family that of the prints?"
                                         : recording.why_no_tag);
  return "of its " + std::to_string(recording.images_with_tags) +
         " images with tags no second is sure enough for the map. Let the robot move for some "
         "seconds while tags are in view, without an IMU before two tags or close to one";
}

std::string text_of_part(const MapPart& part, const std::vector<std::string>& names) {
  std::string text = tags_text(part.tag_ids) + " of " +
                     listed(part.recordings, [&](std::size_t i) { return names[i]; }) +
                     " did not join the map";
  if (part.also_in_map.empty())
    return text +
           ": no recording shows one of them together with the rest. Walk so that one tag is seen "
           "by both: record a way from a tag of the map to one of these without a break, or let "
           "one recording see a tag of the other";
  return text + ", though it has " + tags_text(part.also_in_map) +
         " as well: seen from both they do not lie the same. Was one moved, is a number printed "
         "twice, or was it seen too briefly? Walk so that two tags are seen by both, from near";
}

}  // namespace

int tags_placed(const TagMap& map) {
  return static_cast<int>(std::ranges::count_if(
      map.tags, [](const MapTag& entry) { return entry.state != TagState::kSurveyed; }));
}

std::string MapBuildText::summary() const {
  const Sigmas sigmas = sigmas_of(build.map);
  const int placed = tags_placed(build.map);
  std::string text = fmt::format("{} tags placed of {} seen", placed, all_seen(build).size());
  if (const auto given = static_cast<int>(build.map.tags.size()) - placed; given > 0)
    text += fmt::format(", {} given", given);
  text += "\n";
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    const BuiltRecording& one = build.recordings[i];
    text += fmt::format("  {}: {} of {} images with tags, {} tags; ", recordings[i],
                        one.images_with_tags, one.images, one.seen.size());
    if (one.segments_in_map == 0)
      text += "did not join\n";
    else if (one.segments_in_map < one.segments)
      text += fmt::format("joined with {} of {} pieces\n", one.segments_in_map, one.segments);
    else
      text += "joined\n";
  }
  if (!sigmas.place_m.empty())
    text += fmt::format(
        "  1-sigma of a tag: place median {:.1f} mm, worst {:.1f} mm (tag {}); attitude median "
        "{:.3f} deg, worst {:.3f} deg (tag {})\n",
        1e3 * quantile(sigmas.place_m, 0.5), 1e3 * quantile(sigmas.place_m, 1.0), sigmas.worst_tag,
        kDegreesPerRadian * quantile(sigmas.attitude_rad, 0.5),
        kDegreesPerRadian * quantile(sigmas.attitude_rad, 1.0), sigmas.worst_turned_tag);
  return text + fmt::format(
                    "  residuals {:.2f} times the expected ones; {} of {} sightings contradict the "
                    "rest\n  CPU: {:.1f} s to process, {:.1f} s for the joint solution\n",
                    std::sqrt(build.fit.chi_square_per_number), build.fit.outliers,
                    build.fit.sightings, build.run_cpu_s, build.solve_cpu_s);
}

std::vector<std::string> MapBuildText::left_out() const {
  std::vector<std::string> sentences;
  for (std::size_t i = 0; i < recordings.size(); ++i)
    if (build.recordings[i].segments == 0)
      sentences.push_back(recordings[i] + ": " + why_nothing(build.recordings[i]));
  sentences.insert(sentences.end(), build.moved.begin(), build.moved.end());
  for (const MapPart& part : build.apart) sentences.push_back(text_of_part(part, recordings));
  if (!build.seen_too_seldom.empty())
    sentences.push_back("left out as seen too seldom (map.publish_sightings is " +
                        std::to_string(publish_sightings) +
                        "): " + listed(build.seen_too_seldom, [](const auto& tag) {
                          return "tag " + std::to_string(tag.first) + " (" +
                                 std::to_string(tag.second) + " times)";
                        }));
  if (const auto never = never_placed(build); !never.empty())
    sentences.push_back(
        tags_text(never) + (never.size() == 1 ? " was" : " were") +
        " seen, but never so that it could be placed. Stay longer before it, or come "
        "nearer");
  if (build.last.has_found_workspace)
    sentences.push_back(
        "no recording shows the reference tag" +
        (build.map.reference_tag ? " " + std::to_string(*build.map.reference_tag) : std::string()) +
        ": the workspace is where the largest part began. Record the reference tag as well, or "
        "name "
        "another one: --set map.reference_tag=N");
  if (!build.is_level)
    sentences.push_back(
        "no recording has an IMU: the vertical is a guess. Give map.reference_pose with "
        "map.reference_tag, or tags that lie flat: map.floor_tags");
  if (!build.last.is_at_rest && build.fit.sightings > 0)
    sentences.push_back(
        "the last solution did not converge: the map is the one before it. Measurements "
        "contradict each other: see what fiducap replay reports on each recording");
  return sentences;
}

nlohmann::ordered_json MapBuildText::json() const {
  const Sigmas sigmas = sigmas_of(build.map);
  nlohmann::ordered_json json{{"tags", build.map.tags.size()},
                              {"tags_placed", tags_placed(build.map)},
                              {"tags_seen", all_seen(build).size()},
                              {"place_sigma_median_m", quantile(sigmas.place_m, 0.5)},
                              {"place_sigma_worst_m", quantile(sigmas.place_m, 1.0)},
                              {"attitude_sigma_median_rad", quantile(sigmas.attitude_rad, 0.5)},
                              {"attitude_sigma_worst_rad", quantile(sigmas.attitude_rad, 1.0)},
                              {"chi_square_per_number", build.fit.chi_square_per_number},
                              {"sightings", build.fit.sightings},
                              {"outliers", build.fit.outliers},
                              {"at_rest", build.last.is_at_rest},
                              {"found_workspace", build.last.has_found_workspace},
                              {"level", build.is_level},
                              {"run_cpu_s", build.run_cpu_s},
                              {"solve_cpu_s", build.solve_cpu_s},
                              {"recordings", nlohmann::ordered_json::array()},
                              {"apart", nlohmann::ordered_json::array()},
                              {"left_out", left_out()},
                              {"mismatches", build.mismatches}};
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    const BuiltRecording& one = build.recordings[i];
    json["recordings"].push_back({{"recording", recordings[i]},
                                  {"images", one.images},
                                  {"images_with_tags", one.images_with_tags},
                                  {"tags_seen", one.seen.size()},
                                  {"segments", one.segments},
                                  {"segments_in_map", one.segments_in_map}});
  }
  for (const MapPart& part : build.apart) {
    nlohmann::ordered_json names = nlohmann::ordered_json::array();
    for (const std::size_t i : part.recordings) names.push_back(recordings[i]);
    json["apart"].push_back({{"recordings", names},
                             {"tags", part.tag_ids},
                             {"also_in_map", part.also_in_map},
                             {"segments", part.segments}});
  }
  return json;
}

}  // namespace fiducap
