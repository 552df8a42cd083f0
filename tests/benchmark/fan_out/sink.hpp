#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fan_out/stage.hpp"

namespace fiducap::fan_out {

/// What one client saw.
struct Tally {
  static constexpr std::uint64_t kWarmUp =
      50;  ///< First frames whose latency is not counted: pages, caches, buffers.

  std::string protocol;
  std::string mode;
  std::uint64_t frames{};
  std::uint64_t missing{};  ///< Numbers that never came, between the first and the last one.
  std::vector<float> latency_us;

  void take(std::uint64_t number, double latency);

 private:
  std::uint64_t last_{};
};

/// A client on a raw socket: no more than it takes to know which frame came.
class Sink {
 public:
  virtual ~Sink();
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  [[nodiscard]] int fd() const { return fd_; }
  /// Reads all that is there.
  void pump(std::int64_t now_ns);
  /// Once a second, for protocols whose clients must speak.
  virtual void keep_alive() {}
  /// From now on nothing is taken out of the socket, which holds as little as it can.
  virtual void stop_reading();
  [[nodiscard]] bool reading() const { return reading_; }

  Tally tally;

 protected:
  Sink(int fd, const Load& load, const Shared& shared, std::string protocol, std::string mode);
  /// @return bytes used of a stream; a datagram is used whole
  virtual std::size_t parse(std::span<const std::byte> bytes, std::int64_t now_ns) = 0;
  /// A frame by its number from 1, or by the instant its poses are for.
  void saw_number(std::uint64_t number, std::int64_t now_ns);
  void saw_instant(std::int64_t at_ns, std::int64_t now_ns);
  /// A number that counts on from an unknown start.
  void saw_count(std::uint64_t count, std::int64_t now_ns);
  [[nodiscard]] const Shared& shared() const { return shared_; }

 private:
  int fd_;
  Load load_;
  const Shared& shared_;
  bool reading_{true};
  std::vector<std::byte> in_;
  std::optional<std::int64_t> count_start_;
};

[[nodiscard]] std::unique_ptr<Sink> make_vrpn_sink(const Load& load, const Shared& shared);
[[nodiscard]] std::unique_ptr<Sink> make_natnet_sink(const Load& load, const Shared& shared);
[[nodiscard]] std::unique_ptr<Sink> make_vicon_sink(const Load& load, const Shared& shared);
[[nodiscard]] std::unique_ptr<Sink> make_qualisys_sink(const Load& load, const Shared& shared);

[[nodiscard]] std::int64_t steady_ns();

}  // namespace fiducap::fan_out
