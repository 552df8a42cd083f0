// What the page is told of a set-up.
#include <nlohmann/json.hpp>

#include "capture/imu/imu_part.hpp"
#include "daemon/setup/setup_files.hpp"
#include "daemon/setup/setup_room.hpp"
#include "detection/tag_family_list.hpp"

namespace fiducap {

namespace {

using nlohmann::json;

constexpr std::array<std::pair<SetupStep, const char*>, 9> kSteps{{{SetupStep::kCamera, "camera"},
                                                                   {SetupStep::kPicture, "picture"},
                                                                   {SetupStep::kSheet, "sheet"},
                                                                   {SetupStep::kLens, "lens"},
                                                                   {SetupStep::kImu, "imu"},
                                                                   {SetupStep::kRest, "rest"},
                                                                   {SetupStep::kMount, "mount"},
                                                                   {SetupStep::kWave, "wave"},
                                                                   {SetupStep::kFinish, "finish"}}};

json cameras_json(const SetupGuide& guide) {
  auto all = json::array();
  for (const FoundCamera& camera : guide.cameras())
    all.push_back({{"open", camera.open}, {"name", camera.name}, {"problem", camera.problem}});
  return all;
}

json camera_json(const SetupResult& result) {
  if (result.simulated) return {{"open", SimulatedRig::kName}, {"exposure_ms", nullptr}};
  if (!result.camera.source) return nullptr;
  const CameraDeviceConfig& device = result.camera.source->camera;
  return {{"open", device.open}, {"exposure_ms", 1e3 * device.exposure_s}};
}

json picture_json(const SetupGuide& guide) {
  if (!guide.picture()) return nullptr;
  const SetupPicture& picture = *guide.picture();
  auto outlines = json::array();
  for (const TagSighting& tag : guide.corners().tags) {
    auto corners = json::array();
    for (const Eigen::Vector2d& corner : tag.corners_px)
      corners.push_back({corner.x(), corner.y()});
    outlines.push_back({{"id", tag.tag_id}, {"margin", tag.decision_margin}, {"corners", corners}});
  }
  return {{"width", picture.width},
          {"height", picture.height},
          {"rate_hz", picture.rate_hz},
          {"histogram", picture.measures.histogram},
          {"bright_share", picture.measures.bright_share},
          {"dark_share", picture.measures.dark_share},
          {"focus_px", picture.blur.tags > 0 ? json(picture.blur.focus_px) : json(nullptr)},
          {"motion_px", picture.blur.tags > 0 ? json(picture.blur.motion_px) : json(nullptr)},
          {"verdict", picture.verdict},
          {"good", picture.is_good},
          {"outlines", outlines}};
}

json lens_json(const LensGuide& lens) {
  const LensProgress& p = lens.progress();
  return {{"columns", p.columns}, {"rows", p.rows},       {"points", p.points},
          {"covered", p.covered}, {"views", p.views},     {"tilted", p.tilted},
          {"hint", p.hint},       {"enough", p.is_enough}};
}

json imu_json(const SetupGuide& guide) {
  auto types = json::array();
  for (const auto& word : words::kImuSourceType) types.push_back(word.text);
  return {{"used", guide.result().imu.has_value()},
          {"simulated", guide.result().simulated.has_value()},
          {"rate_hz", guide.imu_rate_hz()},
          {"types", types},
          {"parts", part_names()}};
}

json sheet_json(const TagSetConfig& tags) {
  auto families = json::array();
  for (const TagFamilyFacts& family : tag_families()) families.push_back(family.name);
  return {{"family", tags.family}, {"size_mm", 1e3 * tags.size_m}, {"families", families}};
}

json wave_json(const WaveGuide& wave) {
  const WaveProgress& p = wave.progress();
  return {{"turned", p.turned}, {"shaken", p.shaken}, {"seen", p.seen}, {"hint", p.hint}};
}

json verdict_json(const SetupGuide& guide) {
  if (!guide.verdict()) return nullptr;
  const SetupVerdict& verdict = *guide.verdict();
  return {{"good", verdict.is_good},
          {"refused", verdict.is_refused},
          {"summary", verdict.summary},
          {"advice", verdict.advice}};
}

json steps_json(const SetupGuide& guide) {
  auto all = json::array();
  for (const auto& [step, name] : kSteps) {
    const bool of_imu = step == SetupStep::kRest || step == SetupStep::kWave;
    const bool is_left_out = of_imu && guide.step() > SetupStep::kImu && !guide.result().imu;
    all.push_back({{"name", name}, {"left_out", is_left_out}});
  }
  return all;
}

}  // namespace

std::string setup_json(const SetupGuide& guide, const std::string& file, const std::string& error,
                       bool is_written) {
  const SetupResult& result = guide.result();
  json all{{"step", kSteps[static_cast<std::size_t>(guide.step())].second},
           {"steps", steps_json(guide)},
           {"file", file},
           {"error", error},
           {"solving", guide.is_solving()},
           {"cameras", cameras_json(guide)},
           {"camera", camera_json(result)},
           {"picture", picture_json(guide)},
           {"sheet", sheet_json(result.tags)},
           {"lens", guide.lens() != nullptr ? lens_json(*guide.lens()) : json(nullptr)},
           {"imu", imu_json(guide)},
           {"rest", {{"share", guide.rest().share()}, {"hint", guide.rest().hint()}}},
           {"wave", wave_json(guide.wave())},
           {"verdict", verdict_json(guide)},
           {"written", is_written}};
  if (guide.step() == SetupStep::kFinish) all["configuration"] = setup_preview(file, result);
  return all.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace fiducap
