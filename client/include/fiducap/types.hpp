#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

/// Data of the client. Axes and units as in client.hpp.
namespace fiducap {

enum class Tracking : std::uint8_t { kSearching, kTracking, kCoasting, kLost };

/// One body at one instant.
struct Body {
  int id{};
  std::string name;
  Tracking tracking{Tracking::kSearching};
  bool valid{};  ///< False: no pose; all numbers down to the covariance are NaN.
  std::array<double, 3> position_m{};                  ///< p_WP
  std::array<double, 4> orientation_wxyz{1, 0, 0, 0};  ///< q_WP
  std::array<double, 3> velocity_m_s{};                ///< v_WP, W axes
  std::array<double, 3> body_rate_rad_s{};             ///< w_WP, P axes
  std::array<double, 3> acceleration_m_s2{};           ///< W axes, at rest 0
  double position_sigma_m{};                           ///< 1-sigma of the worst axis
  double rotation_sigma_rad{};
  double velocity_sigma_m_s{};
  double rate_sigma_rad_s{};
  /// Upper triangle, row by row, of the 6x6 covariance of (position, rotation vector), both in W;
  /// m², m·rad, rad². NaN without ClientOptions::covariance.
  std::array<float, 21> pose_covariance{};
  double age_s{};  ///< Since the last image with a tag.
  int tags_in_view{};
};

/// All bodies at one instant.
struct Frame {
  std::uint64_t number{};       ///< Counts up from the start of the server.
  std::int64_t at_server_ns{};  ///< Instant of the poses, server's clock.
  /// The same instant on this machine's steady clock (std::chrono::steady_clock, CLOCK_MONOTONIC),
  /// by clock synchronisation with the server. 0: not known yet, or the server replays a recording.
  std::int64_t at_client_ns{};
  double clock_sigma_s{};              ///< 1-sigma of at_client_ns. NaN: not known.
  std::int64_t at_utc_ns{};            ///< The same instant, nanoseconds since 1970.
  std::int64_t published_server_ns{};  ///< When the server made the frame, server's clock.
  std::int64_t received_ns{};          ///< Arrival, client's steady clock.
  std::int64_t map_version{};
  double rate_hz{};
  std::vector<Body> bodies;
};

enum class WorldUp : std::uint8_t {
  kZ,
  kY,  ///< x' = x, y' = z, z' = -y.
};
/// With y up: the axes that are rotated.
enum class TurnedAxes : std::uint8_t {
  kWorld,         ///< Only the world's axes: q' = F q.
  kWorldAndBody,  ///< Also the bodies' axes: q' = F q F*.
};

struct ClientOptions {
  std::string server{"127.0.0.1"};  ///< Address or host name.
  std::uint16_t port{21600};
  double reconnect_s{0.5};  ///< Pause between attempts to connect; 0.05 … 60.
  std::string name;         ///< For the operator's list of clients, at most 64 bytes.

  // Applied by the server, once for all clients with equal options.
  WorldUp up{WorldUp::kZ};
  TurnedAxes scope{TurnedAxes::kWorld};
  double max_rate_hz{0};            ///< The server skips frames to stay below; 0: every frame.
  std::vector<std::string> bodies;  ///< At most 32 names, also of later bodies; empty: all.
  bool covariance{true};            ///< False: no pose_covariance, smaller frames.
  bool multicast{false};  ///< If the server has a group; falls back to unicast when none arrives.
};

/// Offset of the server's clock from this machine's steady clock: server = ours + offset.
struct ClockStatus {
  bool known{};
  std::int64_t offset_ns{};
  double drift_ppm{};     ///< Growth of the offset in µs per second.
  double sigma_s{};       ///< 1-sigma of the offset from jitter. NaN: not known.
  double bound_s{};       ///< Bound of its error for any asymmetry of the delays.
  double round_trip_s{};  ///< Minimum of the last half minute.
};

/// Counters since construction.
struct ClientStatistics {
  bool connected{};
  std::string problem;  ///< Cause of a missing connection, in one sentence; else empty.
  std::uint64_t frames{};
  std::uint64_t lost{};  ///< Gaps in the frame numbers.
  /// Of these, because the server's socket was full; of the present connection.
  std::uint64_t dropped_by_server{};
  /// Datagrams that this machine dropped because the client's socket was full.
  std::uint64_t dropped_here{};
  std::uint64_t reconnects{};
  double rate_hz{};  ///< Over the last second.
  /// Instant of the pose → arrival, over the last 1000 frames. NaN while the clock offset is
  /// unknown or when the server replays a recording.
  double latency_p50_s{};
  double latency_p99_s{};
  double latency_max_s{};
  ClockStatus clock;
  bool multicast{};  ///< Frames arrive by multicast.
};

}  // namespace fiducap
