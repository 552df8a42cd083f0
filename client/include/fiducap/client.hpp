#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

/// The Fiducap client: poses of rigid bodies from a Fiducap server. C++17, no dependency in this header.
///
/// Axes: workspace W (z up), pivot P of each body. Metres, radians, seconds; quaternions Hamilton, w x y z.
namespace fiducap {

enum class Tracking : std::uint8_t { kSearching, kTracking, kCoasting, kLost };

/// One body at one instant.
struct Body {
  int id{};
  std::string name;
  Tracking tracking{Tracking::kSearching};
  bool valid{};                              ///< False: do not fly with these numbers.
  std::array<double, 3> position_m{};        ///< p_WP
  std::array<double, 4> orientation_wxyz{1, 0, 0, 0};  ///< q_WP
  std::array<double, 3> velocity_m_s{};      ///< v_WP, W axes
  std::array<double, 3> body_rate_rad_s{};   ///< w_WP, P axes
  std::array<double, 3> acceleration_m_s2{}; ///< W axes, at rest 0
  double position_sigma_m{};                 ///< 1-sigma of the worst axis
  double rotation_sigma_rad{};
  double age_s{};                            ///< Since the last image with a tag.
  int tags_in_view{};
};

/// All bodies at one instant.
struct Frame {
  std::uint64_t number{};
  std::int64_t at_server_ns{};   ///< The instant the poses are for, server's clock.
  std::int64_t at_utc_ns{};
  std::int64_t received_ns{};    ///< Arrival, client's steady clock.
  std::int64_t map_version{};
  double rate_hz{};
  std::vector<Body> bodies;
};

struct ClientOptions {
  std::string server{"127.0.0.1"};
  std::uint16_t port{21600};
  double reconnect_s{0.5};       ///< Pause between attempts while the server is away.
};

/// Counters since construction.
struct ClientStatistics {
  bool connected{};
  std::uint64_t frames{};
  std::uint64_t lost{};          ///< Gaps in the frame numbers.
  std::uint64_t reconnects{};
  double rate_hz{};              ///< Over the last second.
  double latency_p50_s{};        ///< Instant of the pose → arrival, over the last 1000 frames (same machine: same clock;
  double latency_p99_s{};        ///< other machine: needs the clock sync of a later version, NaN until then).
};

/// Connects in the background, keeps the subscription alive, comes back by itself when the server does.
class Client {
 public:
  explicit Client(ClientOptions options = {});
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Copies the newest frame into `frame` (its memory is reused). Never waits for the network.
  /// @return false before the first frame.
  bool latest(Frame& frame) const;
  /// The newest pose of one body carried to `ahead` after the instant of its frame with its velocity and rate.
  /// @return false when the body is unknown or not valid.
  bool predict(const std::string& name, std::chrono::nanoseconds ahead, Body& body) const;
  /// Waits until a frame newer than `after_number` is there.
  bool wait_for_frame(std::uint64_t after_number, std::chrono::milliseconds timeout) const;
  /// Called on the client's thread for every frame; keep it short. Set before frames flow or at any time.
  void on_frame(std::function<void(const Frame&)> callback);
  /// Called when the connection comes (true) or goes (false).
  void on_connection(std::function<void(bool connected)> callback);
  ClientStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
