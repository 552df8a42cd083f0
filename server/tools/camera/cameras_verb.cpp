#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/text.hpp"
#include "capture/v4l2/pixel_format.hpp"
#include "tools/camera/camera_verbs.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

using Json = nlohmann::ordered_json;

Json formats_json(const ListedCamera& camera) {
  Json formats = Json::array();
  for (const v4l2::OfferedFormat& format : camera.formats) {
    const v4l2::PixelFormat* known = v4l2::pixel_format(format.code);
    Json sizes = Json::array();
    for (const v4l2::OfferedSize& one : format.sizes)
      sizes.push_back({{"size", {one.size.width, one.size.height}}, {"rates_hz", one.rates_hz}});
    formats.push_back({{"code", v4l2::code_text(format.code)},
                       {"format", known != nullptr ? Json(known->name) : Json(nullptr)},
                       {"description", format.description},
                       {"any_size_between", format.any_size_between},
                       {"sizes", sizes}});
  }
  return formats;
}

Json controls_json(const ListedCamera& camera) {
  Json controls = Json::array();
  for (const v4l2::Control& control : camera.controls) {
    Json choices = Json::array();
    for (const auto& [number, text] : control.choices)
      choices.push_back({{"value", number}, {"text", text}});
    controls.push_back({{"id", control.id},
                        {"name", control.name},
                        {"minimum", control.minimum},
                        {"maximum", control.maximum},
                        {"step", control.step},
                        {"default", control.usual},
                        {"value", control.value ? Json(*control.value) : Json(nullptr)},
                        {"may_be_set", control.may_be_set},
                        {"choices", choices}});
  }
  return controls;
}

Json camera_json(const ListedCamera& camera) {
  Json out{{"device", camera.device},
           {"lasting_name", camera.lasting_name},
           {"name", camera.name},
           {"may_be_opened", !camera.closed},
           {"driver", camera.identity.driver},
           {"bus", camera.identity.bus}};
  if (camera.closed) {
    out["why_not"] = camera.closed->text();
    return out;
  }
  out["formats"] = formats_json(camera);
  out["controls"] = controls_json(camera);
  if (camera.now)
    out["now"] = {{"code", v4l2::code_text(camera.now->code)},
                  {"size", {camera.now->size.width, camera.now->size.height}},
                  {"rate_hz", camera.now->rate_hz}};
  out["configuration"] = source_section(camera);
  return out;
}

std::string rates_text(const std::vector<double>& rates_hz) {
  if (rates_hz.empty()) return "";
  std::string text = " at ";
  constexpr std::size_t kMostNamed = 6;
  for (std::size_t i = 0; i < std::min(rates_hz.size(), kMostNamed); ++i)
    text += (i == 0 ? "" : ", ") + fixed(rates_hz[i], rates_hz[i] < 10 ? 1 : 0);
  return text + (rates_hz.size() > kMostNamed ? ", … Hz" : " Hz");
}

void print_formats(const ListedCamera& camera, std::ostream& out) {
  for (const v4l2::OfferedFormat& format : camera.formats) {
    const v4l2::PixelFormat* known = v4l2::pixel_format(format.code);
    out << "    "
        << (known != nullptr ? std::string(known->name)
                             : v4l2::code_text(format.code) + " (not read here)")
        << ", " << format.description << "\n";
    if (known == nullptr) continue;
    for (std::size_t i = 0; i < format.sizes.size(); ++i)
      out << "      " << (i > 0 && format.any_size_between ? "to " : "")
          << size_text(format.sizes[i].size) << rates_text(format.sizes[i].rates_hz) << "\n";
  }
}

void print_controls(const ListedCamera& camera, std::ostream& out) {
  for (const v4l2::Control& control : camera.controls) {
    out << "    " << control.name << " = "
        << (control.value ? std::to_string(*control.value) : std::string("?"));
    for (const auto& [number, text] : control.choices)
      if (control.value == number) out << " (" << text << ")";
    if (!control.is_yes_or_no && control.choices.empty())
      out << ", " << control.minimum << " to " << control.maximum;
    if (!control.may_be_set) out << ", not now to be set";
    out << "\n";
  }
}

void print_camera(const ListedCamera& camera, std::ostream& out) {
  out << camera.device << "  " << camera.name << "\n";
  if (camera.closed) {
    out << "  " << camera.closed->what << "\n";
    return;
  }
  out << "  driver " << camera.identity.driver << ", " << camera.identity.bus << "\n";
  if (!camera.lasting_name.empty()) out << "  always " << camera.lasting_name << "\n";
  if (camera.now)
    out << "  now " << v4l2::code_text(camera.now->code) << " " << size_text(camera.now->size)
        << " at " << fixed(camera.now->rate_hz, 1) << " Hz\n";
  out << "  formats, with their nominal rates:\n";
  print_formats(camera, out);
  if (!camera.controls.empty()) out << "  controls:\n";
  print_controls(camera, out);
  out << "  for a configuration, below a body:\n\n" << source_section(camera) << "\n";
}

}  // namespace

int run_cameras(const CamerasArguments& arguments, const Terminal& terminal,
                const CameraPlaces& places) {
  const auto cameras = list_cameras(places);
  if (arguments.json) {
    Json all = Json::array();
    for (const ListedCamera& camera : cameras) all.push_back(camera_json(camera));
    return print_json(terminal, {{"cameras", all}});
  }
  for (const ListedCamera& camera : cameras) print_camera(camera, terminal.out);
  if (!cameras.empty()) return kExitOk;
  terminal.out << "No camera: there is no /dev/videoN that gives images.\n"
                  "  USB: plug it in; `lsusb` must show it. Raspberry Pi's own: it is opened as "
                  "`libcamera:`.\n"
                  "  Network: `open: rtsp://…`. ROS 2: `type: ros`.\n";
  return kExitOk;
}

void add_cameras(CLI::App& app, ChosenVerb& chosen) {
  auto* verb = app.add_subcommand(
      "cameras", "Which cameras are plugged in, what can they do, what to write about them");
  auto& a = arguments_of<CamerasArguments>(*verb, chosen, [](const auto& arguments, const auto& t) {
    return run_cameras(arguments, t);
  });
  verb->add_flag("--json", a.json, "One JSON object for scripts");
  verb->footer(
      "Formats, sizes and nominal rates, controls with their values, the name that stays the same "
      "after a restart, and a section for the configuration of fiducapd. Running cameras are not "
      "disturbed.\nExample:\n  fiducap cameras\n"
      "  fiducap cameras --json | jq '.cameras[].lasting_name'");
}

}  // namespace fiducap
