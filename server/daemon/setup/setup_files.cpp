#include "daemon/setup/setup_files.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <numeric>
#include <sstream>

#include <unistd.h>

#include "base/whole_file.hpp"
#include "base/yaml.hpp"
#include "capture/v4l2/camera_list.hpp"
#include "daemon/config/config_file.hpp"
#include "daemon/config/config_visitors.hpp"
#include "daemon/config/server_schema.hpp"
#include "daemon/operator_token.hpp"
#include "detection/sheet/tag_sheet.hpp"
#include "detection/tag_family.hpp"

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
  if (result.camera.source) text += "        source:\n" + section_text(*result.camera.source, 10);
  const std::string lens =
      result.lens_from.empty() ? "a guess, see the sigmas below" : result.lens_from;
  text += "        model:                    # the lens: " + lens + "\n" +
          section_text(mount.model, 10);
  if (mount.focal_sigma > 0) text += "        focal_sigma: " + text_of(mount.focal_sigma) + "\n";
  if (mount.centre_sigma_px > 0)
    text += "        centre_sigma_px: " + text_of(mount.centre_sigma_px) + "\n";
  if (mount.k1_sigma > 0) text += "        k1_sigma: " + text_of(mount.k1_sigma) + "\n";
  text += "        lens_error_px: " + text_of(mount.lens_error_px) +
          "     # residual of the lens model\n";
  const std::string place = result.mount_from.empty()
                                ? "as entered; better values are estimated in motion"
                                : result.mount_from;
  text += "        # Pose of the camera: body x forward, y left, z up; " + place + "\n" +
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
  if (result.simulated)
    text += "    source:\n      type: simulator\n" + section_text(*result.simulated, 6);
  text += camera_text(result);
  if (result.imu_source) text += "    imu_source:\n" + section_text(*result.imu_source, 6);
  if (result.simulated && !result.imu) text += "    use_imu: false\n";
  if (result.imu)
    text += "    imu:                          # " +
            (result.imu_from.empty() ? "usual values of small units" : result.imu_from) + "\n" +
            section_text(*result.imu, 6);
  return text;
}

namespace fs = std::filesystem;

constexpr std::size_t kPrintedTags = 12;  // enough for a room; all families have as many

std::string setup_text(const SetupResult& result, const std::string& store,
                       const std::string& token_file) {
  std::string text =
      "# Made by the set-up of fiducapd. What is not here has its default:\n"
      "# fiducapd --config THIS_FILE --print-config shows all of it, --check-config checks it.\n\n";
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
      text_of(token_file) + "}   # permits to freeze the map, record, rename\n";
  return text;
}

}  // namespace

std::string token_file_of(const std::string& file) {
  return fs::path(file).replace_extension(".token").string();
}

std::vector<FoundCamera> found_cameras() {
  std::vector<FoundCamera> all;
  for (const ListedCamera& camera : list_cameras({}))
    all.push_back({camera.open(), camera.name + " (" + camera.device + ")",
                   camera.closed ? camera.closed->text() : ""});
  return all;
}

Expected<std::string> setup_sheet(const SetupCommand& order) {
  const auto paper = paper_named(order.text("paper"));
  if (!paper)
    return fail(ErrorCode::kInvalid, "must be a4, a3 or letter", "paper = " + order.text("paper"));
  const auto size_mm = order.number("size_mm");
  if (!size_mm || !(*size_mm > 0))
    return fail(ErrorCode::kInvalid, "must be the edge of the black square in mm, e.g. 160",
                "size_mm = " + order.text("size_mm"));
  std::vector<int> ids(kPrintedTags);
  std::iota(ids.begin(), ids.end(), 0);
  return tag_sheet_pdf({listed_tag_family(order.text("family")), ids, *size_mm, *paper});
}

std::string setup_preview(const std::string& file, const SetupResult& result) {
  const std::string name = fs::path(file).filename().string();
  const std::string store = fs::path(name).replace_extension(".sqlite").string();
  return setup_text(result, store, token_file_of(name));
}

Expected<void> can_write_setup(const std::string& file) {
  std::error_code ignored;
  if (fs::exists(file, ignored) && !fs::is_regular_file(file, ignored))
    return fail(ErrorCode::kInvalid, "must be a file", file);
  const fs::path folder = fs::absolute(file).parent_path();
  if (!fs::is_directory(folder, ignored))
    return fail(ErrorCode::kNotFound, "there is no such folder: make it, or name another file",
                folder.string());
  if (::access(folder.c_str(), W_OK) != 0)
    return fail(ErrorCode::kUnavailable,
                "nothing can be written there (" + std::string(std::strerror(errno)) +
                    "): name a file elsewhere",
                folder.string());
  return {};
}

Expected<void> write_setup(const std::string& file, const SetupResult& result, bool replace) {
  std::error_code ignored;
  if (!replace && fs::exists(file, ignored))
    return fail(ErrorCode::kInvalid, "is there already: replace it?", file);
  const std::string text = setup_preview(file, result);
  const auto read = parse_config(text, file);
  if (!read) return fail(ErrorCode::kInvalid, read.error().front().text(), file);
  const std::string token_file = token_file_of(file);
  if (!fs::exists(token_file, ignored))  // an existing one may be in use
    if (auto token = write_whole_file(token_file, net::random_secret() + "\n", 0600); !token)
      return token;
  return write_whole_file(file, text);
}

}  // namespace fiducap
