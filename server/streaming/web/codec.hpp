#pragma once

#include <cmath>
#include <concepts>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/event_board.hpp"
#include "base/log.hpp"
#include "base/numeric.hpp"
#include "mapping/store/map_rows.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/streamer.hpp"

// The page's JSON messages, each an object with `type`. Positions in m, workspace axes, z up;
// quaternions w x y z, unit; a number that is not finite becomes null. Reader: web/src/protocol.ts.
namespace fiducap::web {

/// Rounds to 1 / parts. As a quotient, so that 0.1 is written `0.1`.
[[nodiscard]] inline double rounded(double value, double parts) {
  return std::round(value * parts) / parts;
}

/// Writes JSON into a string, in the order of the calls. (nlohmann::json allocates in its
/// destructor, which ends the process when memory is exhausted.)
class JsonWriter final {
 public:
  /// @param fill  writes the members: member(…)
  template <std::invocable Fill>
  void object(Fill&& fill) {
    enclose('{', fill, '}');
  }
  /// @param fill  writes the elements: value(…), object(…), array(…)
  template <std::invocable Fill>
  void array(Fill&& fill) {
    enclose('[', fill, ']');
  }
  /// Before a value that is an object or an array.
  void name(std::string_view name);
  template <class Value>
  void member(std::string_view name, const Value& value) {
    this->name(name);
    this->value(value);
  }

  /// A member: array with an object per element. @param fill  writes the members of an element
  template <class Range, class Fill>
  void objects(std::string_view name, const Range& range, Fill&& fill) {
    this->name(name);
    array([&] {
      for (const auto& one : range) object([&] { fill(one); });
    });
  }

  void value(std::nullptr_t);
  void value(bool truth);
  /// Shortest text that reads as the same number; null when it is not finite.
  void value(double number);
  template <std::integral Number>
  requires(!std::same_as<Number, bool>) void value(Number number) {
    begin_value();
    out_ += std::to_string(number);
  }
  /// Bytes that are not UTF-8 become U+FFFD.
  void value(std::string_view text);
  void value(const char* text) { value(std::string_view(text)); }
  void value(const std::string& text) { value(std::string_view(text)); }
  /// nullopt becomes null.
  template <class Value>
  void value(const std::optional<Value>& optional) {
    optional ? value(*optional) : value(nullptr);
  }

  [[nodiscard]] std::string take() { return std::move(out_); }

 private:
  template <class Fill>
  void enclose(char open, Fill& fill, char close) {
    begin_value();
    out_ += open;
    needs_comma_ = false;
    fill();
    out_ += close;
    needs_comma_ = true;
  }
  void begin_value();

  std::string out_;
  bool needs_comma_{false};
};

/// @return the body has had a pose in the workspace
[[nodiscard]] bool had_pose(const BodyPose& body);

/// The first message to a page; sent again when the list of bodies changes.
struct Hello {
  std::string_view version;
  std::string_view map_mode;
  double rate_hz{};       ///< Of frames to the page.
  bool takes_commands{};  ///< An operator's token is configured.
};

/// `ticket`: authorises HTTP requests (`Authorization: Bearer`) while the page is connected.
[[nodiscard]] std::string encode_ticket(std::string_view ticket);

/// `hello`: server, version, map_mode, page_rate_hz, takes_commands, bodies [{id, name}]
[[nodiscard]] std::string encode_hello(const Hello& hello, const SceneModel& model);

/// `map`: version, parent, hash, family, reference_tag (or null), comment, tags [{id, edge_m,
/// state, component, sightings, last_seen_utc_ms, p, q, sigma_mm, cov}]; cov is the position
/// covariance xx xy xz yy yz zz in m².
[[nodiscard]] std::string encode_map(const TagMap& map);

/// `fits`: tags [{id, px, sightings, last_seen_utc_ms}], as in TagFit; sightings of this run.
/// @param utc_offset  of the newest frame
[[nodiscard]] std::string encode_fits(std::span<const TagFit> fits, Duration utc_offset);

/// `frame`: number, utc_ms, rate_hz, map_version, bodies [{id, state, valid, p, q, v, speed,
/// turn_rate_deg_s, sigma_mm, sigma_deg, cov, age_ms, latency_ms, tags, image_rate_hz,
/// reprojection_px, images_dropped}]. A body that never had a pose has p, q, v, cov,
/// speed, turn rate, sigmas and age null.
[[nodiscard]] std::string encode_frame(const SceneFrame& frame);

/// `clients`: clients [{protocol, peer, detail, sent, dropped, connected_s}]
[[nodiscard]] std::string encode_clients(std::span<const ClientStatus> clients);

/// `log`: lines [{n, utc_ms, level, module, text}], oldest first; text at most 1000 bytes.
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
/// @param X_RW  of the published map
[[nodiscard]] std::string encode_diff(const TagMap& before, const TagMap& after, const Pose& X_RW);

/// The reply of `/api/v1/state`: every message above under its type's name.
struct StateParts {
  std::string_view hello, map, fits, frame, clients, log, events;  ///< JSON texts; empty: null.
};
[[nodiscard]] std::string encode_state(const StateParts& parts);

}  // namespace fiducap::web
