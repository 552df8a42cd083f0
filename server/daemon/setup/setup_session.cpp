#include "daemon/setup/setup_session.hpp"

#include <filesystem>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "base/process.hpp"
#include "capture/gray_image.hpp"
#include "capture/imu/imu_source.hpp"
#include "capture/imu_sample.hpp"
#include "daemon/operator_token.hpp"
#include "daemon/setup/setup_files.hpp"
#include "daemon/system.hpp"
#include "detection/tag_family.hpp"

namespace fiducap {
namespace {

using nlohmann::json;

/// Of each SetupStep.
constexpr std::array kSteps{"camera", "picture", "sheet", "lens",  "imu",
                            "rest",   "mount",   "wave",  "finish"};

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

json steps_json(const SetupGuide& guide) {
  auto all = json::array();
  for (std::size_t i = 0; i < kSteps.size(); ++i) {
    const auto step = static_cast<SetupStep>(i);
    const bool is_left_out = guide.step() > SetupStep::kImu && guide.is_left_out(step);
    all.push_back(
        {{"name", kSteps[i]}, {"left_out", is_left_out}, {"skipped", guide.is_skipped(step)}});
  }
  return all;
}

/// The state for the page.
std::string setup_json(const SetupGuide& guide, const std::string& file, const std::string& error,
                       bool is_written) {
  const SetupResult& result = guide.result();
  const WaveProgress& wave = guide.wave().progress();
  std::error_code ignored;
  json all{{"step", kSteps[static_cast<std::size_t>(guide.step())]},
           {"steps", steps_json(guide)},
           {"file", file},
           {"exists", std::filesystem::exists(file, ignored)},
           {"missing", guide.missing().value_or("")},
           {"error", error},
           {"solving", guide.is_solving()},
           {"cameras", cameras_json(guide)},
           {"camera", camera_json(result)},
           {"picture", picture_json(guide)},
           {"sheet", sheet_json(result.tags)},
           {"lens", guide.lens() != nullptr ? lens_json(*guide.lens()) : json(nullptr)},
           {"imu", imu_json(guide)},
           {"rest", {{"share", guide.rest().share()}, {"hint", guide.rest().hint()}}},
           {"wave",
            {{"turned", wave.turned},
             {"shaken", wave.shaken},
             {"seen", wave.seen},
             {"hint", wave.hint}}},
           {"verdict", nullptr},
           {"written", is_written}};
  if (const auto& verdict = guide.verdict())
    all["verdict"] = {{"good", verdict->is_good},
                      {"refused", verdict->is_refused},
                      {"summary", verdict->summary},
                      {"advice", verdict->advice}};
  if (guide.step() == SetupStep::kFinish) all["configuration"] = setup_preview(file, result);
  return all.dump(-1, ' ', false, json::error_handler_t::replace);
}

constexpr std::size_t kMostImages = 2;
constexpr std::size_t kMostCommands = 16;
constexpr Duration kShowPeriod = std::chrono::milliseconds(100);
constexpr Duration kRequestLifetime = std::chrono::seconds(2);
constexpr int kPictureWidth_px = 752;

}  // namespace

SetupSession::SetupSession(SetupSurroundings surroundings)
    : surroundings_(std::move(surroundings)),
      secret_(net::random_secret()),
      events_(utc_now_ns),
      inbox_(kMostImages),
      guide_(*this, [this] { show(); }) {
  show();
}

SetupSession::~SetupSession() { inbox_.close(); }

void SetupSession::run(std::stop_token stop) {
  while (inbox_.take(taken_, stop)) {
    carry_out_commands();
    for (Delivery& delivery : taken_) guide_.take(delivery.sample);
    const Instant now = surroundings_.clock.now();
    if (!taken_.empty() && now - shown_at_ < kShowPeriod) continue;
    make_picture();
    show();
  }
  camera_.reset();
  imu_.reset();
}

// --- for the pages -------------------------------------------------------------------------------

bool SetupSession::admits(std::string_view secret) const { return same_secret(secret, secret_); }

std::shared_ptr<const std::string> SetupSession::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

std::shared_ptr<const std::string> SetupSession::picture() {
  picture_asked_ns_ = to_ns(surroundings_.clock.now());
  const std::lock_guard lock(mutex_);
  return picture_;
}

Expected<void> SetupSession::command(Requester by, std::string what,
                                     std::map<std::string, std::string> values) {
  {
    const std::lock_guard lock(mutex_);
    if (commands_.size() >= kMostCommands)
      return fail(ErrorCode::kUnavailable, "too many commands wait: is a calibration running?");
    commands_.push_back({std::move(by), {std::move(what), std::move(values)}});
  }
  inbox_.wake();
  return {};
}

void SetupSession::note_refusal(const Requester& by) {
  surroundings_.access.note_refusal(by, "use the set-up", "wrong secret");
}

Expected<std::string> SetupSession::sheet(std::map<std::string, std::string> order) const {
  return setup_sheet({"sheet", std::move(order)});
}

// --- the guide's thread --------------------------------------------------------------------------

void SetupSession::carry_out_commands() {
  std::vector<std::pair<Requester, SetupCommand>> commands;
  {
    const std::lock_guard lock(mutex_);
    commands.swap(commands_);
  }
  for (const auto& [by, command] : commands) {
    const auto done = command.what == "write" ? write(command) : guide_.command(command);
    std::string what = command.what;
    for (const auto& [key, value] : command.values) what += " " + key + "=" + value;
    surroundings_.access.note(by, what, done);
    error_ = done ? "" : done.error().text();
    show();
  }
}

/// Writes the file and the operator's token; replaces an existing file on request only.
Expected<void> SetupSession::write(const SetupCommand& command) {
  if (guide_.step() != SetupStep::kFinish)
    return fail(ErrorCode::kInvalid, "does not belong to this step", "write");
  auto written = write_setup(surroundings_.file, guide_.result(), command.text("replace") == "yes");
  if (!written) return written;
  is_written_ = true;
  log::info("set-up", "written: " + surroundings_.file);
  surroundings_.written();
  return {};
}

std::vector<FoundCamera> SetupSession::cameras() {
  std::vector<FoundCamera> found = found_cameras();
  if (surroundings_.offers_simulation)
    found.push_back({SimulatedRig::kName, "A simulated robot with camera and IMU", ""});
  return found;
}

Expected<void> SetupSession::use(const CameraDeviceConfig& camera) {
  camera_.reset();  // releases the device, which could not be opened again otherwise
  simulation_.reset();
  inbox_.clear();
  OpenedSource source = nullptr;
  if (camera.open == SimulatedRig::kName && surroundings_.offers_simulation) {
    simulation_ = std::make_unique<SimulatedRig>(&surroundings_.clock);
    source = simulation_->open();
  } else {
    source = open_camera_device(camera, CameraModel{}, surroundings_.clock);
  }
  if (!source) return tl::unexpected(source.error());
  camera_ = read(std::move(*source), "camera");
  return {};
}

Expected<void> SetupSession::use(const ImuSourceConfig& imu) {
  imu_.reset();
  auto source = open_imu_source(imu, {surroundings_.clock, surroundings_.join_dds});
  if (!source) return tl::unexpected(source.error());
  imu_ = read(std::move(*source), "IMU");
  return {};
}

void SetupSession::begin(SetupStep step) {
  if (simulation_) simulation_->begin(step);
}

std::optional<simulation::SimulatedBodyConfig> SetupSession::simulated() const {
  return simulation_ ? std::optional(simulation_->body()) : std::nullopt;
}

std::unique_ptr<SetupSession::Sensor> SetupSession::read(std::unique_ptr<SensorSource> source,
                                                         const char* name) {
  auto sensor = std::make_unique<Sensor>();
  sensor->reader = std::make_unique<BodyReader>(
      BodySource{std::move(source), name, true}, "set-up",
      [this](SensorSample sample) {
        return inbox_.push(std::move(sample), surroundings_.clock.now());
      },
      events_, surroundings_.clock);
  sensor->thread = std::jthread([this, reader = sensor->reader.get()](std::stop_token stop) {
    name_this_thread("read set-up");
    reader->read(std::move(stop));
    inbox_.wake();  // to show it
  });
  return sensor;
}

std::string SetupSession::lost_sensor() const {
  if (!camera_ && guide_.step() != SetupStep::kCamera)
    return "No camera is open: go back and choose it again.";
  if (camera_ && !camera_->reader->reading())
    return "No more images from the camera: is it plugged in? Go back and choose it again.";
  if (imu_ && !imu_->reader->reading())
    return "No more readings from the IMU: is it plugged in? Go back and choose it again.";
  return "";
}

void SetupSession::show() {
  shown_at_ = surroundings_.clock.now();
  auto text = std::make_shared<const std::string>(
      setup_json(guide_, surroundings_.file, error_.empty() ? lost_sensor() : error_, is_written_));
  const std::lock_guard lock(mutex_);
  state_ = std::move(text);
}

void SetupSession::make_picture() {
  const auto& image = guide_.image().image;
  const Instant asked = instant_from_ns(picture_asked_ns_);
  if (!image || surroundings_.clock.now() - asked > kRequestLifetime) return;
  scale_down(*image, kPictureWidth_px, scaled_, sums_);
  encode_jpeg(scaled_, jpeg_);
  auto picture = std::make_shared<const std::string>(jpeg_.begin(), jpeg_.end());
  const std::lock_guard lock(mutex_);
  picture_ = std::move(picture);
}

}  // namespace fiducap
