#include "daemon/setup/setup_result.hpp"

#include <sstream>

#include "base/yaml_values.hpp"
#include "daemon/config/config_printer.hpp"
#include "daemon/config/config_words.hpp"
#include "daemon/config/server_schema.hpp"

namespace fiducap {

namespace {

/// A section with all its keys, `indent` blanks in.
template <typename T>
std::string section_text(T section, std::size_t indent) {
  ConfigPrinter printer;
  describe(printer, section);
  std::istringstream lines(printer.text());
  std::string text;
  for (std::string line; std::getline(lines, line);) text += std::string(indent, ' ') + line + "\n";
  return text;
}

std::string tags_text(const TagSetConfig& tags) {
  std::string text = "tags:\n  family: " + tags.family + "\n  size_m: " + text_of(tags.size_m) +
                     "                 # edge of the black square, as measured on paper\n";
  if (!tags.sizes_m.empty()) text += "  sizes_m: " + text_of(tags.sizes_m) + "\n";
  return text;
}

std::string camera_text(const SetupResult& result) {
  const CameraMount& mount = result.camera.mount;
  std::string text = "    cameras:\n      -\n";
  if (result.camera.source) {
    text += "        source:\n" + section_text(*result.camera.source, 10);
  }
  const std::string lens =
      result.lens_from.empty() ? "a guess, see the sigmas below" : result.lens_from;
  text += "        model:                    # the lens: " + lens + "\n" +
          section_text(mount.model, 10);
  if (mount.focal_sigma > 0) text += "        focal_sigma: " + text_of(mount.focal_sigma) + "\n";
  if (mount.centre_sigma_px > 0)
    text += "        centre_sigma_px: " + text_of(mount.centre_sigma_px) + "\n";
  if (mount.k1_sigma > 0) text += "        k1_sigma: " + text_of(mount.k1_sigma) + "\n";
  text += "        lens_error_px: " + text_of(mount.lens_error_px) +
          "     # what the model leaves, the same wherever a tag was before\n";
  const std::string place = result.mount_from.empty()
                                ? "as told by hand; better values are learned in motion"
                                : result.mount_from;
  text += "        # Where the camera sits: body x forward, y left, z up; " + place + "\n" +
          "        X_BV: " + text_of(mount.X_BV) +
          "\n        position_sigma_m: " + text_of(mount.position_sigma_m) +
          "\n        rotation_sigma_rad: " + text_of(mount.rotation_sigma_rad) +
          "\n        time_shift_s: " + text_of(to_seconds(mount.time_shift)) +
          "\n        time_shift_sigma_s: " + text_of(mount.time_shift_sigma_s) +
          "\n        rate_hz: " + text_of(mount.rate_hz) + "\n";
  return text;
}

std::string body_text(const SetupResult& result) {
  std::string text = "bodies:\n  - name: " + text_of(result.body) + "\n";
  if (result.simulated) {
    text += "    source:\n      type: simulator\n" + section_text(*result.simulated, 6);
  }
  text += camera_text(result);
  if (result.imu_source) text += "    imu_source:\n" + section_text(*result.imu_source, 6);
  if (result.simulated && !result.imu) text += "    use_imu: false\n";
  if (result.imu) {
    text += "    imu:                          # " +
            (result.imu_from.empty() ? "usual values of small units" : result.imu_from) + "\n" +
            section_text(*result.imu, 6);
  }
  return text;
}

}  // namespace

std::string setup_text(const SetupResult& result, const std::string& store,
                       const std::string& token_file) {
  std::string text =
      "# Made by the set-up of fiducapd. What is not here has its default:\n"
      "# fiducapd --config THIS_FILE --print-config shows all of it, --check-config looks it "
      "over.\n\n";
  text += tags_text(result.tags);
  text +=
      "\nmap:\n"
      "  mode: mapping                   # `frozen` once the room is known: then no control loop "
      "sees the map move\n"
      "  store: " +
      text_of(store) + "              # the map, every version of it\n";
  if (result.simulated) text += "\nsimulation:\n" + section_text(result.room, 2);
  text += "\n" + body_text(result);
  text +=
      "\nstreaming:\n"
      "  rate_hz: 100\n"
      "  # This machine only; 0.0.0.0 lets others in.\n"
      "  vrpn: {address: 127.0.0.1}      # " +
      result.body +
      "@127.0.0.1\n"
      "  natnet: {enabled: true, address: 127.0.0.1}\n"
      "  native: {address: 127.0.0.1}    # fiducap::Client, `fiducap watch`\n"
      "  web: {address: 127.0.0.1}\n"
      "\noperator: {token_file: " +
      text_of(token_file) + "}   # whoever knows it may freeze the map, record, rename\n";
  return text;
}

}  // namespace fiducap
