#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "fiducap/types.hpp"

/// The Fiducap client: poses of rigid bodies from a Fiducap server. C++17, no dependency in this
/// header.
///
/// Axes: workspace W (z up), pivot P of each body. Metres, radians, seconds; quaternions Hamilton,
/// w x y z.

#if defined(__GNUC__)
#define FIDUCAP_CLIENT_API __attribute__((visibility("default")))
#else
#define FIDUCAP_CLIENT_API
#endif

namespace fiducap {

/// Receives frames from a server. Connects in the background and reconnects by itself.
///
/// Thread-safe, also in callbacks; only the destructor must not run in a callback. While the
/// server is unreachable `latest` returns the last frame, `statistics().problem` the cause.
class FIDUCAP_CLIENT_API Client {
 public:
  /// Longest prediction of a pose.
  static constexpr std::chrono::milliseconds kMaxPrediction{500};

  /// Returns at once. @throw std::system_error when the system has no thread or descriptor left;
  /// std::invalid_argument when the options have more than 32 bodies or names that do not fit a
  /// datagram.
  explicit Client(ClientOptions options = {});
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Copies the newest frame into `frame`. Wait-free: no lock and no system call; no allocation
  /// once `frame` has held a frame of this size.
  /// @return false before the first frame; `frame` is unchanged then.
  bool latest(Frame& frame) const;
  /// Predicts the newest pose of one body to `ahead` after the instant of its frame, by velocity,
  /// rate, and acceleration for the first 0.1 s. Sigmas and covariance grow with those of velocity
  /// and rate. Wait-free like `latest`.
  /// @return false when the body is unknown or not valid, or `ahead` is beyond kMaxPrediction;
  /// `body` is unchanged.
  bool predict(const std::string& name, std::chrono::nanoseconds ahead, Body& body) const;
  /// The same to `ahead` after now, e.g. when a command given now takes effect.
  /// @return false also while the clock offset is unknown, or when the newest frame is too old for
  /// kMaxPrediction
  bool predict_now(const std::string& name, std::chrono::nanoseconds ahead, Body& body) const;
  /// Waits for a frame newer than `after_number`. The first frame after a restart of the server is
  /// newer than all before.
  /// @return false on timeout
  bool wait_for_frame(std::uint64_t after_number, std::chrono::milliseconds timeout) const;
  /// Sets a function that the client's thread calls for every frame; keep it short, do not throw.
  /// May be replaced or removed (nullptr) at any time; a running call may end after this returns.
  void on_frame(std::function<void(const Frame&)> callback);
  /// Sets a function that is called on the client's thread when the connection is established
  /// (true) or lost (false); also at once if it is established.
  void on_connection(std::function<void(bool connected)> callback);
  ClientStatistics statistics() const;

  /// One server that answered `discover`.
  struct Found {
    std::string address;  ///< For ClientOptions::server.
    std::uint16_t port{};
    std::string host;  ///< Its host name.
    std::string version;
    int bodies{};
    double rate_hz{};
  };
  /// Searches this machine and all attached networks (IPv4 broadcast) for servers. Takes the whole
  /// `timeout`.
  /// @return each server once, in the order of the replies
  static std::vector<Found> discover(std::chrono::milliseconds timeout, std::uint16_t port = 21600);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
