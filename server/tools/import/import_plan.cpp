#include <algorithm>
#include <filesystem>

#include "base/text.hpp"
#include "capture/ros_image.hpp"
#include "detection/detector_config.hpp"
#include "detection/tag_family.hpp"
#include "tools/import/import.hpp"

namespace fiducap {
namespace {

// Guess for an unknown lens: 64° wide, as in cameras of robots and phones, with 1-sigma; the filter
// estimates the rest.
constexpr double kGuessedFocal = 0.8;  // of the width
constexpr double kGuessedFocalSigma = 0.15;
constexpr double kGuessedCentreSigma = 0.03;  // of the width
constexpr double kGuessedK1Sigma = 0.1;
constexpr double kUnknownPlace_m = 0.1;
constexpr double kUnknownPlace_rad = 0.1;

std::string all_there_is(const ImportSource& source) {
  constexpr std::size_t kMost = 20;
  std::vector<std::string> names = source.others();
  names.insert(names.begin(), source.streams().size(), "");
  std::ranges::transform(source.streams(), names.begin(), &FoundStream::text);
  const std::size_t count = names.size();
  names.resize(std::min(count, kMost));
  if (count > kMost) names.push_back("and " + std::to_string(count - kMost) + " more");
  return names.empty() ? "nothing" : comma_list(names);
}

Expected<std::size_t> find_stream(const ImportSource& source, const std::string& name,
                                  FoundKind kind) {
  const auto& streams = source.streams();
  std::vector<std::string> there;
  for (std::size_t i = 0; i < streams.size(); ++i) {
    if (streams[i].kind != kind) continue;
    if (streams[i].name == name) return i;
    there.push_back(streams[i].text());
  }
  const std::string what = kind == FoundKind::kImu ? "IMU" : "images";
  return fail(ErrorCode::kNotFound, "no " + what + " called " + name + "; there is: " +
                                        (there.empty() ? all_there_is(source) : comma_list(there)));
}

/// Images that are used by default: brightness, of a known size, not twice.
std::vector<std::size_t> usable_images(const ImportSource& source) {
  const auto& streams = source.streams();
  std::vector<std::size_t> usable;
  for (std::size_t i = 0; i < streams.size(); ++i) {
    const FoundStream& s = streams[i];
    if (s.kind != FoundKind::kImages || s.is_depth || s.mount.model.width == 0) continue;
    const bool twin =
        ros::is_compressed(s.name) && std::ranges::any_of(streams, [&](const FoundStream& raw) {
          return raw.kind == FoundKind::kImages && raw.name + "/compressed" == s.name &&
                 raw.count > 0;
        });
    if (!twin) usable.push_back(i);
  }
  return usable;
}

Expected<void> choose_images(const ImportSource& source, const ImportArguments& arguments,
                             ImportChoice& choice) {
  if (arguments.images == std::vector<std::string>{"none"}) return {};
  for (const std::string& name : arguments.images) {
    const auto found = find_stream(source, name, FoundKind::kImages);
    if (!found) return tl::unexpected(found.error());
    if (source.streams()[*found].mount.model.width == 0)
      return fail(ErrorCode::kInvalid,
                  name + " has no image that can be read: " + source.streams()[*found].first_fault);
    choice.images.push_back(*found);
  }
  if (!choice.images.empty()) return {};
  choice.images = usable_images(source);
  const auto& streams = source.streams();
  const auto is_imu = [](const FoundStream& stream) { return stream.kind == FoundKind::kImu; };
  if (!streams.empty() && std::ranges::all_of(streams, is_imu)) return {};
  const auto is_depth = [](const FoundStream& stream) { return stream.is_depth; };
  if (const auto depth = std::ranges::find_if(streams, is_depth);
      choice.images.empty() && depth != streams.end())
    return fail(ErrorCode::kNotFound, "has depth images only (" + depth->text() +
                                          " is taken for one); if these are pictures: --image " +
                                          depth->name);
  if (choice.images.empty())
    return fail(
        ErrorCode::kNotFound,
        "has no images (sensor_msgs/Image or CompressedImage, a video, pictures); there is: " +
            all_there_is(source));
  if (choice.images.size() == 1 || source.is_one_rig()) return {};
  std::string choices;
  for (const std::size_t i : choice.images)
    choices += "\n  --image " + source.streams()[i].name + "   " + source.streams()[i].text();
  return fail(ErrorCode::kInvalid, "has images of " + std::to_string(choice.images.size()) +
                                       " cameras. Choose those of the body:" + choices);
}

/// The accelerometer of a gyroscope that is a topic of its own (RealSense): the only one, or the
/// only one below the same first part of the name.
std::optional<std::size_t> accelerometer_of(const ImportSource& source, std::size_t gyro) {
  const auto device = [](const std::string& name) { return name.substr(0, name.find('/', 1)); };
  std::vector<std::size_t> all;
  std::vector<std::size_t> beside;
  for (std::size_t i = 0; i < source.streams().size(); ++i) {
    const FoundStream& stream = source.streams()[i];
    if (stream.kind != FoundKind::kImu || stream.has_gyro || !stream.has_accel) continue;
    all.push_back(i);
    if (device(stream.name) == device(source.streams()[gyro].name)) beside.push_back(i);
  }
  if (all.size() == 1) return all.front();
  return beside.size() == 1 ? std::optional(beside.front()) : std::nullopt;
}

/// Completes a gyroscope by its accelerometer.
Expected<void> take_imu(const ImportSource& source, std::size_t imu, ImportChoice& choice) {
  const FoundStream& stream = source.streams()[imu];
  choice.imu = imu;
  if (stream.has_gyro && stream.has_accel) return {};
  if (stream.has_gyro) choice.accel = accelerometer_of(source, imu);
  if (choice.accel) return {};
  return fail(
      ErrorCode::kInvalid,
      stream.name + " has only zeros as " +
          (stream.has_gyro    ? "accelerations, and which topic is its accelerometer is unclear"
           : stream.has_accel ? "turn rates: name the topic of the gyroscope, --imu TOPIC"
                              : "readings") +
          "; without an IMU: --imu none");
}

Expected<void> choose_imu(const ImportSource& source, const ImportArguments& arguments,
                          ImportChoice& choice) {
  if (arguments.imu == std::vector<std::string>{"none"}) return {};
  for (const std::string& name : arguments.imu) {
    const auto found = find_stream(source, name, FoundKind::kImu);
    if (!found) return tl::unexpected(found.error());
    const FoundStream& stream = source.streams()[*found];
    auto& taken = stream.has_gyro || arguments.imu.size() == 1 ? choice.imu : choice.accel;
    if (taken)
      return fail(ErrorCode::kInvalid, "two IMUs are a gyroscope and an accelerometer; " +
                                           comma_list(arguments.imu) + " are not");
    taken = *found;
  }
  if (choice.imu && choice.accel) return {};
  if (choice.imu) return take_imu(source, *choice.imu, choice);
  std::vector<std::size_t> whole;
  std::vector<std::size_t> gyros;
  std::string choices;
  for (std::size_t i = 0; i < source.streams().size(); ++i) {
    const FoundStream& stream = source.streams()[i];
    if (stream.kind != FoundKind::kImu || stream.count == 0) continue;
    if (stream.has_gyro) (stream.has_accel ? whole : gyros).push_back(i);
    choices += "\n  --imu " + stream.name + "   " + std::to_string(stream.count) + " readings, " +
               fixed(stream.rate_hz(), 0) + " Hz" +
               (!stream.has_accel  ? ", gyroscope only"
                : !stream.has_gyro ? ", accelerometer only"
                                   : "");
  }
  const auto& candidates = whole.empty() ? gyros : whole;
  if (candidates.size() == 1) return take_imu(source, candidates.front(), choice);
  if (choices.empty()) return {};
  return fail(ErrorCode::kInvalid,
              "has " + std::to_string(candidates.size()) +
                  " IMUs with a gyroscope. Choose that of the body:" + choices + "\n  --imu none");
}

/// Checks the stamps of a chosen stream. @return Error when none is usable
Expected<void> judge_stamps(const FoundStream& stream, bool by_header,
                            std::vector<std::string>& remarks) {
  const std::string of = " of " + std::to_string(stream.count) + " stamps ";
  if (stream.count > 0 && stream.zero_stamps == stream.count)
    return fail(ErrorCode::kInvalid,
                stream.name + ": all " + std::to_string(stream.count) + " stamps are zero" +
                    (by_header ? "; take the recorder's time with --stamps log" : ""));
  if (stream.zero_stamps > 0)
    remarks.push_back(stream.name + ": " + std::to_string(stream.zero_stamps) + of +
                      "are zero: left out");
  if (stream.backwards > 0)
    remarks.push_back(stream.name + ": " + std::to_string(stream.backwards) + of +
                      "go backwards or are repeated: a replay leaves them out" +
                      (by_header ? " (--stamps log takes the recorder's time)" : ""));
  if (stream.unreadable > 0)
    remarks.push_back(stream.name + ": " + std::to_string(stream.unreadable) +
                      " cannot be read, and are left out; the first: " + stream.first_fault);
  return {};
}

void guess_lens(CameraMount& mount) {
  CameraModel& model = mount.model;
  const double width = std::max(model.width, model.height);
  model.fu = model.fv = kGuessedFocal * width;
  model.cu = 0.5 * (model.width - 1);
  model.cv = 0.5 * (model.height - 1);
  model.distortion = Distortion::kRadialTangential;
  model.coefficients = {};
  mount.focal_sigma = kGuessedFocalSigma;
  mount.centre_sigma_px = kGuessedCentreSigma * width;
  mount.k1_sigma = kGuessedK1Sigma;
}

/// A camera of the recording; unknown values are guessed and listed in `to_do`.
CameraMount camera_of(const FoundStream& camera, std::size_t k, bool has_imu,
                      const std::string& out, std::vector<std::string>& to_do) {
  CameraMount mount = camera.mount;
  const std::string file = out + "/mav0/cam" + std::to_string(k) + "/sensor.yaml";
  if (!camera.lens_known) {
    guess_lens(mount);
    to_do.push_back("lens of " + camera.name + ": not in the source (" + camera.lens_fault + "). " +
                    file +
                    " has a guess for 64°: `fiducap calibrate camera` finds it, --calibration FILE "
                    "takes it over, or write intrinsics and distortion_coefficients there and "
                    "remove intrinsics_sigma");
  }
  if (camera.place != CameraPlace::kOnBody && has_imu) {
    mount.position_sigma_m = kUnknownPlace_m;
    mount.rotation_sigma_rad = kUnknownPlace_rad;
    to_do.push_back("place of " + camera.name + " on the IMU: not in the source. " + file +
                    " has T_BS for equal axes (x right, y down, z forward): write the rough one "
                    "there, then `fiducap calibrate extrinsics`; or --calibration "
                    "camchain-imucam.yaml");
  } else if (camera.place == CameraPlace::kUnknown && k > 0) {
    to_do.push_back("place of " + camera.name +
                    " beside the first camera: not in the source. "
                    "Write T_BS in " +
                    file);
  }
  if (camera.rate_hz() > 0) mount.rate_hz = camera.rate_hz();
  return mount;
}

void take_tags(const ImportSource& source, const ImportArguments& arguments, ImportPlan& plan) {
  const RecordingInfo about = source.about();
  RecordingInfo& info = plan.info;
  info.X_BI = about.X_BI;
  info.tag_family = about.tag_family;
  info.tag_size_m = about.tag_size_m;
  info.tag_sizes_m = about.tag_sizes_m;
  info.ignore_tags = about.ignore_tags;
  info.max_hamming = about.max_hamming;
  info.reference_tag = about.reference_tag;
  info.known_tags = about.known_tags;
  if (arguments.tag_size_m > 0) {
    info.tag_size_m = arguments.tag_size_m;
    info.tag_sizes_m.clear();
  }
  if (!arguments.tag_family.empty()) info.tag_family = arguments.tag_family;
  info.tag_family = listed_tag_family(info.tag_family);
  if (arguments.tag_size_m > 0 || source.has_tags()) return;
  plan.to_do.push_back("size of the tags: not in the source. " + arguments.out +
                       "/mav0/tags.yaml has " + info.tag_family + " of " +
                       fixed(info.tag_size_m, 3) +
                       " m: give --tag-size (and --tag-family), or "
                       "write default_size_m there");
}

}  // namespace

Expected<ImportChoice> choose_streams(const ImportSource& source,
                                      const ImportArguments& arguments) {
  ImportChoice choice;
  if (const auto chosen = choose_images(source, arguments, choice); !chosen)
    return tl::unexpected(chosen.error());
  if (const auto chosen = choose_imu(source, arguments, choice); !chosen)
    return tl::unexpected(chosen.error());
  if (choice.images.empty() && !choice.imu)
    return fail(ErrorCode::kInvalid, "has neither images nor an IMU to take");
  return choice;
}

Expected<ImportPlan> plan_import(const ImportSource& source, const ImportArguments& arguments) {
  ImportPlan plan;
  TagSetConfig tags;
  if (!arguments.tag_family.empty()) tags.family = arguments.tag_family;
  if (const auto faults = tags.check(); !faults.empty())
    return fail(ErrorCode::kInvalid, faults.front().text(), "--tag-family");
  const auto choice = choose_streams(source, arguments);
  if (!choice) return tl::unexpected(choice.error());
  plan.choice = *choice;
  const bool by_header = arguments.stamps == "header";
  std::vector<FoundStream> cameras;
  for (const std::size_t i : choice->images) cameras.push_back(source.streams()[i]);
  std::optional<ImuNoise> noise;
  if (choice->imu) noise = source.streams()[*choice->imu].noise;
  if (const auto done = apply_calibrations(arguments.calibrations, cameras, noise); !done)
    return tl::unexpected(done.error());
  plan.info.folder = arguments.out;
  plan.info.name = std::filesystem::path(arguments.out).filename().string();
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    if (const auto good = judge_stamps(cameras[k], by_header, plan.remarks); !good)
      return tl::unexpected(good.error());
    if (const int bits = cameras[k].used_bits; bits > 8 && bits < 16)
      plan.remarks.push_back(cameras[k].name + ": its 16-bit images use " + std::to_string(bits) +
                             " bits, of which the highest eight are taken");
    plan.info.cameras.push_back(
        camera_of(cameras[k], k, choice->imu.has_value(), arguments.out, plan.to_do));
    plan.info.has_images.push_back(true);
    plan.info.has_corners.push_back(false);
  }
  if (!cameras.empty()) take_tags(source, arguments, plan);
  if (!choice->imu) return plan;
  const FoundStream& imu = source.streams()[*choice->imu];
  if (const auto good = judge_stamps(imu, by_header, plan.remarks); !good)
    return tl::unexpected(good.error());
  if (!noise && !cameras.empty())
    plan.to_do.push_back("noise of the IMU: not in the source. " + arguments.out +
                         "/mav0/imu0/sensor.yaml has that of a common MEMS unit: `fiducap "
                         "calibrate imu` finds it, --calibration imu.yaml takes it over");
  plan.info.imu = noise.value_or(ImuNoise{});
  if (imu.rate_hz() > 0) plan.info.imu->rate_hz = imu.rate_hz();
  if (choice->accel)
    plan.remarks.push_back(imu.name + " has the gyroscope only: the accelerometer of " +
                           source.streams()[*choice->accel].name +
                           " is interpolated to its stamps");
  return plan;
}

}  // namespace fiducap
