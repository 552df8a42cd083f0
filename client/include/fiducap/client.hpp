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

#if defined(__GNUC__)
#define FIDUCAP_CLIENT_API __attribute__((visibility("default")))
#else
#define FIDUCAP_CLIENT_API
#endif

namespace fiducap {

enum class Tracking : std::uint8_t { kSearching, kTracking, kCoasting, kLost };

/// One body at one instant.
struct Body {
  int id{};
  std::string name;
  Tracking tracking{Tracking::kSearching};
  bool valid{};                              ///< False: there is no pose; all numbers down to the covariance are NaN.
  std::array<double, 3> position_m{};        ///< p_WP
  std::array<double, 4> orientation_wxyz{1, 0, 0, 0};  ///< q_WP
  std::array<double, 3> velocity_m_s{};      ///< v_WP, W axes
  std::array<double, 3> body_rate_rad_s{};   ///< w_WP, P axes
  std::array<double, 3> acceleration_m_s2{}; ///< W axes, at rest 0
  double position_sigma_m{};                 ///< 1-sigma of the worst axis
  double rotation_sigma_rad{};
  /// Upper triangle, row by row, of the 6x6 covariance of (position, rotation vector), both in W; m², m·rad, rad².
  std::array<float, 21> pose_covariance{};
  double age_s{};                            ///< Since the last image with a tag.
  int tags_in_view{};
};

/// All bodies at one instant.
struct Frame {
  std::uint64_t number{};        ///< Counts up by one; starts again at 1 when the server starts again.
  std::int64_t at_server_ns{};   ///< The instant the poses are for, server's clock.
  std::int64_t at_utc_ns{};      ///< The same instant, nanoseconds since 1970.
  std::int64_t published_server_ns{};  ///< When the server made the frame, server's clock.
  std::int64_t received_ns{};    ///< Arrival, client's steady clock.
  std::int64_t map_version{};
  double rate_hz{};
  std::vector<Body> bodies;
};

struct ClientOptions {
  std::string server{"127.0.0.1"};  ///< Address or host name.
  std::uint16_t port{21600};
  double reconnect_s{0.5};       ///< Pause between attempts while the server is away; 0.05 … 60.
  std::string name;              ///< What the server's operator sees in the list of clients, at most 64 bytes.
};

/// Counters since construction.
struct ClientStatistics {
  bool connected{};
  std::string problem;           ///< While not connected: why, in one sentence for a person. Else empty.
  std::uint64_t frames{};
  std::uint64_t lost{};          ///< Gaps in the frame numbers.
  std::uint64_t reconnects{};
  double rate_hz{};              ///< Over the last second.
  /// Instant of the pose → arrival, over the last 1000 frames. NaN when the server is on another machine or replays a
  /// recording: its clock is not ours then.
  double latency_p50_s{};
  double latency_p99_s{};
};

/// Connects in the background, keeps the subscription alive, comes back by itself when the server does.
///
/// All methods may be called from any thread, also from callbacks; only the destructor must not run in a callback.
/// A server that is away is no error: `latest` keeps answering with the last frame, `statistics().problem` says why.
class FIDUCAP_CLIENT_API Client {
 public:
  /// Returns at once. @throw std::system_error only when the system has no thread or descriptor left.
  explicit Client(ClientOptions options = {});
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Copies the newest frame into `frame`. Wait-free: no lock and no system call, whatever the network and other
  /// readers do; no allocation once `frame` has held a frame of this size.
  /// @return false before the first frame; `frame` is unchanged then.
  bool latest(Frame& frame) const;
  /// The newest pose of one body carried to `ahead` after the instant of its frame with its velocity and rate.
  /// @return false when the body is unknown or not valid.
  bool predict(const std::string& name, std::chrono::nanoseconds ahead, Body& body) const;
  /// Waits until a frame newer than `after_number` is there. After a restart of the server its first frame is newer
  /// than all before.
  /// @return false when the time is over.
  bool wait_for_frame(std::uint64_t after_number, std::chrono::milliseconds timeout) const;
  /// Called on the client's thread for every frame; keep it short, do not throw. May be set, replaced and taken away
  /// (nullptr) at any time; a call under way may end after this returns.
  void on_frame(std::function<void(const Frame&)> callback);
  /// Called on the client's thread when the connection comes (true) or goes (false); at once when it is already there.
  void on_connection(std::function<void(bool connected)> callback);
  ClientStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
