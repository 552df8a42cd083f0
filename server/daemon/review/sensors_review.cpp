// The sensors of the bodies.
#include <cmath>
#include <sstream>

#include "base/numeric.hpp"
#include "base/yaml.hpp"
#include "capture/camera_device.hpp"
#include "capture/gray_image.hpp"
#include "capture/imu/imu_source.hpp"
#include "daemon/bodies/body_setup.hpp"
#include "daemon/review/config_review.hpp"
#include "daemon/system.hpp"

namespace fiducap {
namespace {

// Largest distance of a camera from the body's origin.
constexpr double kFarthestCamera_m = 3;
// Plausible angles of view.
constexpr double kNarrowest_deg = 8;
constexpr double kWidest_deg = 170;
constexpr double kMostAspect = 1.1;  // of a pixel; square ones are the rule
constexpr double kMostOffCentre = 0.25;
constexpr double kMostGyroNoise = 0.05;  // rad/s/√Hz; the worst parts on sale have 0.001
constexpr double kMostAccelNoise = 0.5;

std::string number(double value) {
  std::ostringstream text;
  text.precision(4);
  text << value;
  return text.str();
}

void review_lens(const CameraMount& mount, const std::string& path, ConfigReview& review) {
  const CameraModel& lens = mount.model;
  if (!lens.check().empty()) return;  // provided by its source, or a fault of its file
  const double angle = 2 * std::atan2(lens.width / 2.0, lens.fu) * kDegreesPerRadian;
  if (lens.distortion != Distortion::kEquidistant &&
      (angle < kNarrowest_deg || angle > kWidest_deg))
    review.doubt(
        path + "model.fu", number(lens.fu),
        "means a view of " + number(angle) + " degrees: is it in pixels, and of this image size?");
  if (lens.fu > kMostAspect * lens.fv || lens.fv > kMostAspect * lens.fu)
    review.doubt(path + "model.fv", number(lens.fv),
                 "differs from fu by more than pixels do (fu = " + number(lens.fu) +
                     "): calibrate again (`fiducap calibrate camera`)");
  const double off_u = std::abs(lens.cu - lens.width / 2.0) / lens.width;
  const double off_v = std::abs(lens.cv - lens.height / 2.0) / lens.height;
  if (std::max(off_u, off_v) > kMostOffCentre)
    review.doubt(path + "model.cu", number(lens.cu) + ", cv = " + number(lens.cv),
                 "is far from the middle of " + size_text(lens.width, lens.height) +
                     ": is the calibration of another image size, or of a cut image?");
  if ((mount.focal_sigma > 0 || mount.k1_sigma > 0) && !has_calibrated_lens(mount))
    review.doubt(path + "focal_sigma", number(mount.focal_sigma),
                 "means that the lens is a guess: it is estimated, but run `fiducap calibrate "
                 "camera` before relying on a pose");
  if (mount.X_BV.p.norm() > kFarthestCamera_m)
    review.doubt(path + "X_BV", number(mount.X_BV.p.norm()) + " m",
                 "is far from the body's origin: places are in metres, not millimetres");
}

void review_imu(const ImuNoise& imu, const std::string& path, ConfigReview& review) {
  if (imu.gyro_noise_rad_s_rtHz > kMostGyroNoise)
    review.doubt(path + "gyro_noise_rad_s_rtHz", number(imu.gyro_noise_rad_s_rtHz),
                 "is more than any unit has: data sheets give degrees, divide by 57.3");
  if (imu.accel_noise_m_s2_rtHz > kMostAccelNoise)
    review.doubt(path + "accel_noise_m_s2_rtHz", number(imu.accel_noise_m_s2_rtHz),
                 "is more than any unit has: data sheets give micro-g, multiply by 9.81e-6");
}

std::string imu_text(const ImuSourceConfig& imu) {
  return text_of_word<ImuSourceType>(words::kImuSourceType, imu.type);
}

/// Opens it as the server would, without waiting for readings. Topics need to join a domain and are
/// not checked.
void review_imu_source(const ImuSourceConfig& imu, const std::string& path, ConfigReview& review) {
  if (imu.type == ImuSourceType::kPx4 || imu.type == ImuSourceType::kRos) return;
  static const SystemClock clock;
  const auto opened = open_imu_source(imu, {clock, {}});
  if (!opened) review.fault(path + "imu_source", imu_text(imu), opened.error().text());
}

/// Opens the device or file as the server would, for its image size.
void review_device(CameraDeviceConfig device, CameraModel lens, const std::string& path,
                   ConfigReview& review) {
  device.paced = false;
  static const SystemClock clock;
  // A file has a size of its own; of a device this can be judged without it.
  const PixelSize size = is_file(device) ? PixelSize{} : PixelSize{device.width, device.height};
  const auto fits = fits_calibration(size, lens, device.open);
  if (size.width > 0 && !fits) {
    review.fault(path + "width", std::to_string(size.width), fits.error().what);
    lens = {};  // opened with any size
  }
  const auto opened = open_camera_device(device, lens, clock);
  if (!opened) return review.fault(path + "open", device.open, opened.error().what);
  if (!is_file(device)) return;
  auto first = (*opened)->next({});
  if (!first) return review.fault(path + "open", device.open, first.error().what);
  if (!first->has_value()) review.fault(path + "open", device.open, "has no image");
}

void review_cameras(const BodyConfig& body, const BodySetup& setup, const std::string& path,
                    ConfigReview& review) {
  const auto& mounts = setup.sensors.cameras;
  for (std::size_t k = 0; k < mounts.size(); ++k) {
    const std::string camera = path + "cameras." + std::to_string(k) + ".";
    review_lens(mounts[k], camera, review);
    if (k >= body.cameras.size() || !body.cameras[k].source) continue;
    const CameraSourceConfig& own = *body.cameras[k].source;
    if (own.type == CameraSourceType::kCamera)
      review_device(own.camera, mounts[k].model, camera + "source.", review);
  }
  if (body.source.type == SourceType::kCamera && mounts.size() == 1)
    review_device(body.source.camera, mounts.front().model, path + "source.", review);
}

std::string sources_text(const BodyConfig& body) {
  switch (body.source.type) {
    case SourceType::kSimulator:
      return "a simulated robot";
    case SourceType::kRecording:
      return "the recording " + body.source.recording.folder;
    case SourceType::kCamera:
      return body.source.camera.open;
    case SourceType::kRos:
      return "ROS 2 topics";
    case SourceType::kSensors:
      break;
  }
  std::vector<std::string> names;
  for (const CameraConfig& camera : body.cameras) {
    if (!camera.source) continue;
    const bool by_ros = camera.source->type == CameraSourceType::kRos;
    names.push_back(by_ros ? camera.source->ros.source.images.front() : camera.source->camera.open);
  }
  return comma_list(names);
}

void plan_body(const BodyConfig& body, const BodySetup& setup, ConfigReview& review) {
  std::string line = "body " + body.name + " (id " + std::to_string(body.id) + "): ";
  line += std::to_string(setup.sensors.cameras.size()) + " camera";
  if (setup.sensors.cameras.size() != 1) line += "s";
  for (const CameraMount& mount : setup.sensors.cameras)
    line += mount.model.width == 0 ? ", its lens by its source"
                                   : ", " + size_text(mount.model.width, mount.model.height);
  line += setup.sensors.imu ? ", with IMU" : ", without IMU";
  if (body.imu_source) line += " (" + imu_text(*body.imu_source) + ")";
  review.plan.push_back(line + ", from " + sources_text(body));
}

}  // namespace

void review_sensors(const ServerConfig& config, ConfigReview& review) {
  for (std::size_t i = 0; i < config.bodies.size(); ++i) {
    const BodyConfig& body = config.bodies[i];
    const std::string at = "bodies." + std::to_string(i);
    const std::string path = at + ".";
    std::vector<Error> faults;
    const BodySetup setup = read_body_setup(body, config.simulation, config.site, faults);
    for (const Error& fault : faults) review.fault(at, body.name, fault.text());
    review_cameras(body, setup, path, review);
    if (body.imu_source && body.use_imu) review_imu_source(*body.imu_source, path, review);
    if (setup.sensors.imu) review_imu(*setup.sensors.imu, path + "imu.", review);
    if (faults.empty()) plan_body(body, setup, review);
  }
}

}  // namespace fiducap
