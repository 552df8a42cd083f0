// The rules of all modules, and those between them.
#include <algorithm>
#include <set>

#include "base/text.hpp"
#include "capture/imu_sample.hpp"
#include "capture/sample_merger.hpp"
#include "daemon/config/sockets.hpp"
#include "scene/body_name.hpp"

namespace fiducap {
namespace {

using Errors = std::vector<ConfigError>;

/// Modules use paths of their own section (`vrpn.port`); in the file it is `streaming.vrpn.port`.
void append(Errors& all, Errors more, const std::string& prefix) {
  for (auto& error : more) {
    for (std::size_t from = 0; from != std::string::npos; from = prefix.find('.', from)) {
      if (from > 0) ++from;
      const std::string tail = prefix.substr(from);
      if (error.path.rfind(tail, 0) != 0) continue;
      error.path = prefix + error.path.substr(tail.size());
      break;
    }
    all.push_back(std::move(error));
  }
}

/// The paths of these are those of the file.
void append(Errors& all, const Checker& rules) {
  all.insert(all.end(), rules.errors.begin(), rules.errors.end());
}

void check_imu(Errors& all, const ImuConfig& noise, const std::string& prefix) {
  std::vector<std::string> parts;
  for (const std::string_view part : part_names()) parts.emplace_back(part);
  const bool is_known = noise.part.empty() || noise_of_part(noise.part, noise.rate_hz);
  append(all, Checker{prefix}
                  .require(is_known, "part", noise.part, must_be_one_of(parts, noise.part))
                  .positive("gyro_noise_rad_s_rtHz", noise.gyro_noise_rad_s_rtHz)
                  .not_negative("gyro_walk_rad_s2_rtHz", noise.gyro_walk_rad_s2_rtHz)
                  .positive("accel_noise_m_s2_rtHz", noise.accel_noise_m_s2_rtHz)
                  .not_negative("accel_walk_m_s3_rtHz", noise.accel_walk_m_s3_rtHz)
                  .positive("rate_hz", noise.rate_hz)
                  .not_negative("gyro_range_rad_s", noise.gyro_range_rad_s)
                  .not_negative("accel_range_m_s2", noise.accel_range_m_s2));
}

constexpr double kLargestClockError_s = 0.2;
// A less certain lens is useless.
constexpr double kLargestFocalError = 0.3;
constexpr double kLargestCentreError_px = 1000;
constexpr double kLargestDistortionError = 1;

/// @param has_lens  in a file, or provided by the source
void check_mount(Errors& all, const CameraMount& mount, bool has_lens, const std::string& prefix) {
  append(all, Checker{prefix}
                  .not_negative("position_sigma_m", mount.position_sigma_m)
                  .not_negative("rotation_sigma_rad", mount.rotation_sigma_rad)
                  .within("time_shift_sigma_s", mount.time_shift_sigma_s, 0, kLargestClockError_s)
                  .within("readout_s", mount.readout_s, 0, kLargestClockError_s)
                  .within("readout_sigma_s", mount.readout_sigma_s, 0, kLargestClockError_s)
                  .within("focal_sigma", mount.focal_sigma, 0, kLargestFocalError)
                  .within("centre_sigma_px", mount.centre_sigma_px, 0, kLargestCentreError_px)
                  .within("k1_sigma", mount.k1_sigma, 0, kLargestDistortionError)
                  .within("lens_error_px", mount.lens_error_px, 0, kLargestLensError_px)
                  .positive("rate_hz", mount.rate_hz));
  if (!has_lens) append(all, mount.model.check(), prefix + "model.");
}

void check_source(Errors& all, const BodyConfig& body, const std::string& prefix) {
  SourceSurroundings around;
  for (const CameraConfig& camera : body.cameras) {
    around.cameras.push_back(camera.mount);
    around.calibrated_by_files |= !camera.calibration.empty();
    around.has_source.push_back(camera.source.has_value());
  }
  around.has_imu = body.imu || !body.kalibr_imu.empty();
  around.has_imu_source = body.imu_source.has_value();
  visit_source(body.source, [&](const auto& source) {
    append(all, check_source(source, around, prefix), prefix);
  });
}

void check_camera(Errors& all, const BodyConfig& body, std::size_t camera,
                  const std::string& prefix) {
  const CameraConfig& config = body.cameras[camera];
  const bool is_provided = provides_lens(body.source, config) && config.mount.model.width == 0;
  check_mount(all, config.mount, is_provided || !config.calibration.empty(), prefix);
  if (!config.source) return;
  append(all, config.source->check(prefix + "source."), prefix + "source.");
  append(all, Checker{prefix}.require(
                  body.source.type == SourceType::kSensors, "source", "{…}",
                  "is given beside the `source` of its body: remove one of the two"));
}

void check_body(Errors& all, const BodyConfig& body, const std::string& prefix) {
  const auto name_fault = body_name_fault(body.name);
  append(all, Checker{prefix}
                  .require(!name_fault, "name", shown_name(body.name), name_fault.value_or(""))
                  .require(body.id >= 1, "id", body.id, "must be >= 1")
                  .require(body.filter == "robocentric" || body.filter == "world", "filter",
                           body.filter, "must be robocentric or world")
                  .require(body.cameras.size() <= kMostCameras, "cameras", body.cameras.size(),
                           "are too many: a body has at most " + std::to_string(kMostCameras)));
  check_source(all, body, prefix);
  for (std::size_t i = 0; i < body.cameras.size(); ++i)
    check_camera(all, body, i, prefix + "cameras." + std::to_string(i) + ".");
  if (body.imu) check_imu(all, *body.imu, prefix + "imu.");
  if (body.imu_source)
    append(all, body.imu_source->check(prefix + "imu_source."), prefix + "imu_source.");
  append(all, body.limits.check(prefix + "limits."), prefix + "limits.");
}

void check_streaming(Errors& all, const StreamingConfig& streaming) {
  Checker rules{"streaming."};
  rules.within("rate_hz", streaming.rate_hz, 1, 1000);
  std::vector<std::string> names;
  for_each_protocol([&names](std::string_view name) { names.emplace_back(name); });
  for (const auto& name : streaming.optional)
    rules.require(std::ranges::find(names, name) != names.end(), "optional", name,
                  "must be some of " + comma_list(names));
  append(all, rules);
  for_each_protocol(
      [&all](std::string_view name, const auto& config) {
        append(all, config.check(), "streaming." + std::string(name) + ".");
      },
      streaming);
}

/// An alias of an unknown body is a typing error.
void check_aliases(Errors& all, std::string_view protocol, const NameAliases& aliases,
                   const std::vector<std::string>& bodies) {
  Checker rules{"streaming." + std::string(protocol) + ".aliases."};
  for (const auto& entry : aliases) {
    const bool known = std::ranges::find(bodies, entry.first) != bodies.end();
    rules
        .require(known, entry.first, '"' + entry.second + '"',
                 "must be an alias of one of the bodies")
        .require(!entry.second.empty(), entry.first, "\"\"", "must not be empty");
  }
  append(all, rules);
}

/// The rules between protocols and bodies.
void check_served_bodies(Errors& all, const ServerConfig& config) {
  std::vector<std::string> bodies;
  for (const auto& body : config.bodies) bodies.push_back(body.name);
  for_each_protocol(
      [&](std::string_view name, const auto& protocol) {
        if constexpr (requires { protocol.check_bodies(bodies); })
          append(all, protocol.check_bodies(bodies), "streaming." + std::string(name) + ".");
        if constexpr (requires { protocol.aliases; })
          check_aliases(all, name, protocol.aliases, bodies);
      },
      config.streaming);
}

/// The rule between all sections that open ports.
void check_sockets(Errors& all, const ServerConfig& config) {
  const auto sockets = sockets_of(config);
  for (std::size_t i = 0; i < sockets.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const OwnSocket& one = sockets[i];
      if (!one.collides_with(sockets[j])) continue;
      all.push_back({one.key(), one.value(),
                     "opens port " + text_of(one.port) + ", which " + sockets[j].key() + " = " +
                         sockets[j].value() + " opens, too: give one of them another port"});
    }
}

void check_unique(Errors& all, const std::vector<BodyConfig>& bodies) {
  std::set<std::string> names;
  std::set<int> ids;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    Checker rules{"bodies." + std::to_string(i) + "."};
    rules
        .require(names.insert(bodies[i].name).second, "name", '"' + bodies[i].name + '"',
                 "is taken by another body")
        .require(ids.insert(bodies[i].id).second, "id", bodies[i].id, "is taken by another body");
    append(all, rules);
  }
}

void check_map(Errors& all, const MapSettings& map) {
  append(all, map.builder.check(), "map.");
  append(all, Checker{"map."}
                  .positive("file_tag_size_m", map.file_tag_size_m)
                  .not_negative("correction_ramp_s", map.correction_ramp_s)
                  .require(!map.reference_pose || map.reference_tag, "reference_pose", "{…}",
                           "needs reference_tag")
                  .require(!map.reference_pose || map.floor_tags.empty(), "floor_tags", "[…]",
                           "has no effect beside reference_pose, which defines the vertical: "
                           "remove one of them"));
}

}  // namespace

std::vector<ConfigError> check_source(const SensorsConfig&, const SourceSurroundings& around,
                                      const std::string& body_prefix) {
  Checker rules{body_prefix};
  rules
      .require(!around.cameras.empty(), "cameras", "0 entries",
               "must have at least one camera, each with a source of its own")
      .require(!around.has_imu || around.has_imu_source, "imu", "{…}",
               "has no source: set `imu_source`");
  for (std::size_t k = 0; k < around.has_source.size(); ++k)
    rules.require(around.has_source[k], "cameras." + std::to_string(k) + ".source", "nothing",
                  "must be set: the body has no `source` for all sensors");
  return rules.errors;
}

std::vector<ConfigError> SiteConfig::check() const {
  constexpr double kLeast_m_s2 = 9.7;  // of the whole Earth, mountains too
  constexpr double kMost_m_s2 = 9.9;
  return Checker{"site."}
      .within("gravity_m_s2", gravity_m_s2.value_or(kUsualGravity_m_s2), kLeast_m_s2, kMost_m_s2)
      .within("latitude_deg", latitude_deg.value_or(0), -90, 90)
      .within("height_m", height_m, -500, 9000)
      .require(!gravity_m_s2 || !latitude_deg, "latitude_deg", latitude_deg.value_or(0),
               "has no effect beside gravity_m_s2: remove one of them")
      .require(height_m == 0 || latitude_deg, "height_m", height_m, "needs latitude_deg beside it")
      .errors;
}

std::vector<ConfigError> check(const ServerConfig& config) {
  Errors all;
  append(all, config.site.check(), "site.");
  append(all, config.tags.check(), "tags.");
  append(all, config.detector.check(), "detector.");
  append(all, config.estimator.check(), "estimator.");
  check_map(all, config.map);
  append(all, simulation::check(config.simulation, "simulation."), "simulation.");
  for (std::size_t i = 0; i < config.bodies.size(); ++i)
    check_body(all, config.bodies[i], "bodies." + std::to_string(i) + ".");
  check_unique(all, config.bodies);
  check_streaming(all, config.streaming);
  check_served_bodies(all, config);
  check_sockets(all, config);
  append(all, config.dds.check(), "dds.");
  append(all, config.operators.check(), "operator.");
  return all;
}

}  // namespace fiducap
