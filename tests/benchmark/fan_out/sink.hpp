#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fan_out/stage.hpp"

namespace fiducap::fan_out {

/// Frames of one client.
struct Tally {
  /// First frames whose latency is not counted: pages, caches, buffers.
  static constexpr std::uint64_t kWarmUp = 50;

  std::string protocol;
  std::string mode;
  std::uint64_t frames{};
  std::uint64_t missing{};  ///< Numbers that never came, between the first and the last one.
  std::vector<float> latency_us;

  void take(std::uint64_t number, double latency);

 private:
  std::uint64_t last_{};
};

/// A client on a raw socket, which parses no more than the number of a frame.
class Sink {
 public:
  virtual ~Sink();
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  [[nodiscard]] int fd() const { return fd_; }
  /// Reads all that is there.
  void pump(std::int64_t now_ns);
  /// Once a second, for protocols whose clients must send.
  virtual void keep_alive() {}

  Tally tally;

 protected:
  Sink(int fd, const Load& load, const Shared& shared, std::string protocol, std::string mode);
  /// @return bytes used of a stream; a datagram is used whole
  virtual std::size_t parse(std::span<const std::byte> bytes, std::int64_t now_ns) = 0;
  /// A frame by its number from 1, or by the instant of its poses.
  void saw_number(std::uint64_t number, std::int64_t now_ns);
  void saw_instant(std::int64_t at_ns, std::int64_t now_ns);
  /// A number that counts from an unknown start.
  void saw_count(std::uint64_t count, std::int64_t now_ns);
  [[nodiscard]] const Shared& shared() const { return shared_; }

 private:
  int fd_;
  Load load_;
  const Shared& shared_;
  std::vector<std::byte> in_;
  std::optional<std::int64_t> count_start_;
};

/// One client of VRPN (TCP), NatNet, Vicon and Qualisys each.
[[nodiscard]] std::vector<std::unique_ptr<Sink>> make_sinks(const Load& load, const Shared& shared);

[[nodiscard]] std::int64_t steady_ns();

}  // namespace fiducap::fan_out
