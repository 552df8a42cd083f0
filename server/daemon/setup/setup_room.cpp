#include "daemon/setup/setup_room.hpp"

#include <filesystem>
#include <utility>

#include "base/log.hpp"
#include "base/this_thread.hpp"
#include "capture/imu/imu_source.hpp"
#include "capture/jpeg_image.hpp"
#include "daemon/secret.hpp"
#include "daemon/setup/setup_files.hpp"
#include "daemon/system_clock.hpp"

namespace fiducap {

namespace {

constexpr std::size_t kMostImages = 2;
constexpr std::size_t kMostCommands = 16;
constexpr Duration kShowPeriod = std::chrono::milliseconds(100);
constexpr Duration kAskedLately = std::chrono::seconds(2);
constexpr int kPictureWidth_px = 752;

}  // namespace

SetupRoom::SetupRoom(SetupSurroundings surroundings)
    : surroundings_(std::move(surroundings)),
      secret_(fresh_secret()),
      events_(utc_now_ns),
      inbox_(kMostImages),
      guide_(*this, [this] { show(); }) {
  show();
}

SetupRoom::~SetupRoom() { inbox_.close(); }

void SetupRoom::run(std::stop_token stop) {
  while (inbox_.take(taken_, stop)) {
    obey();
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

bool SetupRoom::admits(std::string_view secret) const { return is_secret(secret, secret_); }

std::shared_ptr<const std::string> SetupRoom::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

std::shared_ptr<const std::string> SetupRoom::picture() {
  picture_asked_ns_ = to_ns(surroundings_.clock.now());
  const std::lock_guard lock(mutex_);
  return picture_;
}

Expected<void> SetupRoom::command(std::string what, std::map<std::string, std::string> values) {
  {
    const std::lock_guard lock(mutex_);
    if (commands_.size() >= kMostCommands)
      return fail(ErrorCode::kUnavailable, "too many commands wait: is something solved for?");
    commands_.push_back({std::move(what), std::move(values)});
  }
  inbox_.wake();
  return {};
}

Expected<std::string> SetupRoom::sheet(std::map<std::string, std::string> order) const {
  return setup_sheet({"sheet", std::move(order)});
}

// --- the guide's thread --------------------------------------------------------------------------

void SetupRoom::obey() {
  std::vector<SetupCommand> commands;
  {
    const std::lock_guard lock(mutex_);
    commands.swap(commands_);
  }
  for (const SetupCommand& command : commands) obey(command);
}

void SetupRoom::obey(const SetupCommand& command) {
  const auto done = command.what == "write" ? write(command) : guide_.command(command);
  error_ = done ? "" : done.error().text();
  show();
}

/// The file, and the operator's token beside it. Never over a file that is there, unless told so.
Expected<void> SetupRoom::write(const SetupCommand& command) {
  if (guide_.step() != SetupStep::kFinish)
    return fail(ErrorCode::kInvalid, "does not belong to this step", "write");
  auto written = write_setup(surroundings_.file, guide_.result(), command.text("replace") == "yes");
  if (!written) return written;
  is_written_ = true;
  log::info("set-up", "written: " + surroundings_.file);
  surroundings_.written();
  return {};
}

std::vector<FoundCamera> SetupRoom::cameras() {
  std::vector<FoundCamera> found = found_cameras();
  if (surroundings_.offers_simulation)
    found.push_back({SimulatedRig::kName, "A simulated robot with camera and IMU", ""});
  return found;
}

Expected<void> SetupRoom::use(const CameraDeviceConfig& camera) {
  camera_.reset();  // lets go of the device, which could not be opened again otherwise
  simulation_.reset();
  inbox_.clear();
  Expected<std::unique_ptr<SensorSource>> source = nullptr;
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

Expected<void> SetupRoom::use(const ImuSourceConfig& imu) {
  imu_.reset();
  auto source = open_imu_source(imu, {surroundings_.clock, surroundings_.join_dds});
  if (!source) return tl::unexpected(source.error());
  imu_ = read(std::move(*source), "IMU");
  return {};
}

void SetupRoom::begin(SetupStep step) {
  if (simulation_) simulation_->begin(step);
}

std::optional<simulation::SimulatedBodyConfig> SetupRoom::simulated() const {
  return simulation_ ? std::optional(simulation_->body()) : std::nullopt;
}

std::unique_ptr<SetupRoom::Sensor> SetupRoom::read(std::unique_ptr<SensorSource> source,
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
    inbox_.wake();  // to say so
  });
  return sensor;
}

std::string SetupRoom::lost_sensor() const {
  if (!camera_ && guide_.step() != SetupStep::kCamera)
    return "No camera is open: go back and choose it again.";
  if (camera_ && !camera_->reader->reading())
    return "The camera gives no images any more: is it plugged in? Go back and choose it again.";
  if (imu_ && !imu_->reader->reading())
    return "The IMU gives no readings any more: is it plugged in? Go back and choose it again.";
  return "";
}

void SetupRoom::show() {
  shown_at_ = surroundings_.clock.now();
  auto text = std::make_shared<const std::string>(
      setup_json(guide_, surroundings_.file, error_.empty() ? lost_sensor() : error_, is_written_));
  const std::lock_guard lock(mutex_);
  state_ = std::move(text);
}

void SetupRoom::make_picture() {
  const auto& image = guide_.image().image;
  const Instant asked = instant_from_ns(picture_asked_ns_);
  if (!image || surroundings_.clock.now() - asked > kAskedLately) return;
  scale_down(*image, kPictureWidth_px, scaled_, sums_);
  encode_jpeg(scaled_, jpeg_);
  auto picture = std::make_shared<const std::string>(jpeg_.begin(), jpeg_.end());
  const std::lock_guard lock(mutex_);
  picture_ = std::move(picture);
}

}  // namespace fiducap
