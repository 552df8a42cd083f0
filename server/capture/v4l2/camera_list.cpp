#include "capture/v4l2/camera_list.hpp"

#include <algorithm>
#include <fstream>
#include <tuple>
#include <utility>

#include <linux/videodev2.h>

#include "base/text.hpp"
#include "capture/v4l2/pixel_format.hpp"

namespace fiducap {
namespace {

namespace fs = std::filesystem;

std::optional<int> number_of(const std::string& file) {
  constexpr std::string_view kVideo = "video";
  if (!file.starts_with(kVideo) || file.size() > kVideo.size() + 4) return std::nullopt;
  const std::string digits = file.substr(kVideo.size());
  if (digits.empty() || digits.find_first_not_of("0123456789") != std::string::npos)
    return std::nullopt;
  return std::stoi(digits);
}

std::string lasting_name_of(const fs::path& folder, const fs::path& device) {
  std::error_code error;
  for (const char* kind : {"by-id", "by-path"}) {
    for (const auto& entry : fs::directory_iterator(folder / "v4l" / kind, error)) {
      std::error_code broken;
      if (fs::equivalent(entry.path(), device, broken)) return entry.path().string();
    }
  }
  return "";
}

/// @return false: it is no camera
bool fill_in(ListedCamera& camera, const CameraPlaces& places) {
  auto port = places.open(camera.device);
  if (!port) {
    camera.closed = port.error();
    return port.error().code != ErrorCode::kNotFound;
  }
  const auto identity = v4l2::identify(**port, camera.device);
  if (!identity) return false;
  camera.identity = *identity;
  camera.formats = v4l2::offered_formats(**port, *identity);
  camera.controls = v4l2::controls(**port);
  camera.now = v4l2::current_mode(**port, *identity);
  if (!camera.identity.card.empty()) camera.name = camera.identity.card;
  return true;
}

bool is_better(const SuggestedMode& a, const SuggestedMode& b) {
  constexpr double kQuick_hz = 25;
  constexpr int kEnough_px = 1'300'000;
  const auto rank = [](const SuggestedMode& mode) {
    const int px = mode.size.width * mode.size.height;
    const bool is_good = mode.rate_hz >= kQuick_hz && px <= kEnough_px;
    return std::tuple(is_good, is_good ? px : 0, mode.rate_hz);
  };
  return rank(a) > rank(b);
}

std::string key_line(const std::string& key_and_value, const std::string& comment) {
  constexpr std::size_t kColumn = 34;
  std::string text = "  " + key_and_value;
  if (!comment.empty()) {
    text.resize(std::max(text.size() + 2, kColumn), ' ');
    text += "# " + comment;
  }
  return text + "\n";
}

}  // namespace

std::vector<ListedCamera> list_cameras(const CameraPlaces& places) {
  std::vector<std::pair<int, std::string>> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(places.devices, error)) {
    const std::string file = entry.path().filename().string();
    if (const auto number = number_of(file)) files.emplace_back(*number, file);
  }
  std::ranges::sort(files);
  std::vector<ListedCamera> cameras;
  for (const auto& [number, file] : files) {
    ListedCamera camera;
    camera.device = (places.devices / file).string();
    camera.lasting_name = lasting_name_of(places.devices, camera.device);
    std::ifstream name(places.names / file / "name");
    std::getline(name, camera.name);
    if (fill_in(camera, places)) cameras.push_back(std::move(camera));
  }
  return cameras;
}

std::optional<SuggestedMode> suggest_mode(const ListedCamera& camera) {
  std::optional<SuggestedMode> best;
  for (const v4l2::OfferedFormat& format : camera.formats) {
    const v4l2::PixelFormat* known = v4l2::pixel_format(format.code);
    if (known == nullptr) continue;
    for (const v4l2::OfferedSize& one : format.sizes) {
      const SuggestedMode mode{std::string(known->name), one.size,
                               one.rates_hz.empty() ? 0 : one.rates_hz.front()};
      if (!best || is_better(mode, *best)) best = mode;
    }
  }
  return best;
}

std::string source_section(const ListedCamera& camera) {
  std::string text =
      "source:\n" + key_line("type: camera", "") +
      key_line("open: " + camera.open(), camera.lasting_name.empty()
                                             ? "may have another number after a restart"
                                             : "the same after a restart");
  if (const auto mode = suggest_mode(camera)) {
    text += key_line("width: " + std::to_string(mode->size.width), "calibrate this size");
    text += key_line("height: " + std::to_string(mode->size.height), "");
    if (mode->rate_hz > 0) text += key_line("rate_hz: " + shortest(mode->rate_hz), "");
  }
  text += key_line("format: auto", "the fastest as measured; the log names it");
  constexpr std::uint32_t kExposure = V4L2_CID_EXPOSURE_ABSOLUTE;
  if (std::ranges::find(camera.controls, kExposure, &v4l2::Control::id) != camera.controls.end()) {
    text += key_line("exposure_s: 0.005", "short, against motion blur; then more light or gain");
  } else {
    text += key_line("# exposure_s: 0.005", "cannot be set; its value, if known");
  }
  for (const v4l2::Control& control : camera.controls) {
    const std::string range =
        std::to_string(control.minimum) + " to " + std::to_string(control.maximum);
    if (control.id == V4L2_CID_GAIN && control.value)
      text += key_line("gain: " + std::to_string(*control.value), range);
    if (control.id == V4L2_CID_FOCUS_ABSOLUTE)
      text += key_line("focus: 0", range + "; fixed: the calibration depends on it");
  }
  return text;
}

}  // namespace fiducap
