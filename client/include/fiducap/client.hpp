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

/// Connects in the background, keeps the subscription alive, comes back by itself when the server
/// does.
///
/// All methods may be called from any thread, also from callbacks; only the destructor must not run
/// in a callback. A server that is away is no error: `latest` keeps answering with the last frame,
/// `statistics().problem` says why.
class FIDUCAP_CLIENT_API Client {
 public:
  /// No pose is carried further than this: the body has done something else meanwhile.
  static constexpr std::chrono::milliseconds kMaxPrediction{500};

  /// Returns at once. @throw std::system_error only when the system has no thread or descriptor
  /// left; std::invalid_argument when the options ask for more than 32 bodies or names that do not
  /// fit a datagram.
  explicit Client(ClientOptions options = {});
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Copies the newest frame into `frame`. Wait-free: no lock and no system call, whatever the
  /// network and other readers do; no allocation once `frame` has held a frame of this size.
  /// @return false before the first frame; `frame` is unchanged then.
  bool latest(Frame& frame) const;
  /// The newest pose of one body carried to `ahead` after the instant of its frame: velocity, rate,
  /// and for the first 0.1 s its acceleration. Sigmas and covariance grow with those of velocity
  /// and rate. Wait-free like `latest`.
  /// @return false when the body is unknown or not valid, or `ahead` is beyond kMaxPrediction;
  /// `body` is unchanged.
  bool predict(const std::string& name, std::chrono::nanoseconds ahead, Body& body) const;
  /// The same for the instant that is `ahead` after now, e.g. when a command given now takes
  /// effect.
  /// @return false also while the clocks are not known, and when the newest frame is too old for
  /// kMaxPrediction.
  bool predict_now(const std::string& name, std::chrono::nanoseconds ahead, Body& body) const;
  /// Waits until a frame newer than `after_number` is there. After a restart of the server its
  /// first frame is newer than all before.
  /// @return false when the time is over.
  bool wait_for_frame(std::uint64_t after_number, std::chrono::milliseconds timeout) const;
  /// Called on the client's thread for every frame; keep it short, do not throw. May be set,
  /// replaced and taken away (nullptr) at any time; a call under way may end after this returns.
  void on_frame(std::function<void(const Frame&)> callback);
  /// Called on the client's thread when the connection comes (true) or goes (false); at once when
  /// it is already there.
  void on_connection(std::function<void(bool connected)> callback);
  ClientStatistics statistics() const;

  /// One server that answered `discover`.
  struct Found {
    std::string address;  ///< What to put into ClientOptions::server.
    std::uint16_t port{};
    std::string host;  ///< Its own name.
    std::string version;
    int bodies{};
    double rate_hz{};
  };
  /// Asks on this machine and on all networks it is in (IPv4 broadcast) who is there. Takes the
  /// whole `timeout`.
  /// @return each server once, in the order of the answers; empty: none answered.
  static std::vector<Found> discover(std::chrono::milliseconds timeout, std::uint16_t port = 21600);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
