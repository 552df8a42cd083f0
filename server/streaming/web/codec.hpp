#pragma once

#include <span>
#include <string>
#include <string_view>

#include "base/event_board.hpp"
#include "base/log.hpp"
#include "mapping/store/map_rows.hpp"
#include "scene/scene_frame.hpp"
#include "scene/tag_fits.hpp"
#include "streaming/streamer.hpp"

// The page's JSON messages, each an object with `type`. Positions in m, workspace axes, z up;
// quaternions w x y z, unit; a number that is not finite becomes null. The reader is
// web/src/protocol.ts.
namespace fiducap::web {

/// What a page learns first, and again when the list of bodies changes.
struct Hello {
  std::string server_name;
  std::string version;
  std::string map_mode;
  double rate_hz{};       ///< Frames the page will get, per second.
  bool takes_commands{};  ///< Of who knows the operator's token; false: there is none.
};

/// `hello`: server, version, map_mode, page_rate_hz, takes_commands, bodies [{id, name}]
[[nodiscard]] std::string encode_hello(const Hello& hello, const SceneModel& model);

/// `map`: version, parent, hash, family, reference_tag (or null), comment, tags [{id, edge_m,
/// state, component, sightings, last_seen_utc_ms, p, q, sigma_mm, cov}]; cov is the position
/// covariance xx xy xz yy yz zz in m².
[[nodiscard]] std::string encode_map(const TagMap& map);

/// `fits`: tags [{id, px, sightings, last_seen_utc_ms}], as TagFit says; sightings of this run.
/// @param utc_offset  of the newest frame
[[nodiscard]] std::string encode_fits(std::span<const TagFit> fits, Duration utc_offset);

/// `frame`: number, utc_ms, rate_hz, map_version, bodies [{id, state, valid, p, q, v, speed,
/// turn_rate_deg_s, sigma_mm, sigma_deg, cov, age_ms, latency_ms, tags, image_rate_hz,
/// reprojection_px, images_dropped}]. A body that was never placed in the workspace has p, q, v,
/// cov, speed, turn rate, sigmas and age null: it has no pose, not even an old one.
[[nodiscard]] std::string encode_frame(const SceneFrame& frame);

/// `clients`: clients [{protocol, peer, detail, sent, dropped, connected_s}]
[[nodiscard]] std::string encode_clients(std::span<const ClientStatus> clients);

/// `log`: lines [{n, utc_ms, level, room, text}], oldest first; a text longer than 1000 bytes is
/// cut.
[[nodiscard]] std::string encode_log(std::span<const log::Line> lines);

/// `events`: standing and events, each [{n, utc_ms, severity, subject, kind, text, remedy, over}]:
/// conditions that hold, in order of subject and kind, and the newest events, oldest first. A text
/// longer than 1000 bytes is cut.
[[nodiscard]] std::string encode_events(std::span<const Event> standing,
                                        std::span<const Event> newest);

/// `versions`: versions [{version, parent, utc_ms, tags, comment}], newest first.
[[nodiscard]] std::string encode_versions(std::span<const MapVersionInfo> versions);

/// `diff`: before, after, changes [{id, kind, mm, deg, from, to}]; from and to are places, null
/// where the tag is not.
/// @param X_RW  as the map that is served lies in the room: stored tags are in the workspace
[[nodiscard]] std::string encode_diff(const TagMap& before, const TagMap& after, const Pose& X_RW);

/// The answer of `/api/v1/state`: every message above under its type's name.
struct StateParts {
  std::string_view hello, map, fits, frame, clients, log, events;  ///< JSON texts; empty: null.
};
[[nodiscard]] std::string encode_state(const StateParts& parts);

}  // namespace fiducap::web
