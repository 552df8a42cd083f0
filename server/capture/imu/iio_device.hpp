#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/expected.hpp"
#include "capture/imu/iio_config.hpp"

struct iio_buffer;
struct iio_channel;
struct iio_context;
struct iio_device;

/// libiio, as far as IMUs need it. Its header is seen by iio_device.cpp alone.
namespace fiducap::iio {

/// A session with the kernel of this machine or with iiod of another one.
class Context final {
 public:
  /// @return Error saying what does not answer
  [[nodiscard]] static Expected<Context> open(const std::string& uri);

  /// A device by its name, its label or its id; empty: the first one with such a channel.
  /// @param channel  e.g. `anglvel_x`   @return Error naming the devices that there are
  [[nodiscard]] Expected<iio_device*> find(const std::string& name, const char* channel) const;
  [[nodiscard]] iio_device* find_trigger(const std::string& name) const;
  [[nodiscard]] bool is_local() const;

 private:
  struct Close {
    void operator()(iio_context* context) const;
  };
  explicit Context(iio_context* context) : context_(context) {}
  std::unique_ptr<iio_context, Close> context_;
};

/// One device whose readings come in buffers with the kernel's stamps.
class Device final {
 public:
  struct Wanted {
    bool gyro{false};
    bool accel{false};
  };
  /// One reading in SI units, in the axes that the mount matrix says.
  struct Reading {
    std::int64_t stamp_ns{};
    Eigen::Vector3d w{Eigen::Vector3d::Zero()};
    Eigen::Vector3d f{Eigen::Vector3d::Zero()};
  };

  /// Sets rate, clock and trigger, and starts the buffer.
  /// @return Error naming the device and what it does not do
  [[nodiscard]] static Expected<Device> open(const Context& context, iio_device* device,
                                             Wanted wanted, const IioConfig& config);

  /// Waits for the next buffer. @return true: readings came; false: none in time; Error: lost
  [[nodiscard]] Expected<bool> refill();
  [[nodiscard]] const std::vector<Reading>& readings() const { return readings_; }

  [[nodiscard]] const std::string& name() const { return name_; }
  /// Stamps are on this machine's monotonic clock.
  [[nodiscard]] bool is_on_our_clock() const { return is_on_our_clock_; }
  [[nodiscard]] std::optional<double> rate_hz() const { return rate_hz_; }

 private:
  struct Triad {
    std::array<iio_channel*, 3> channels{};
    Eigen::Vector3d scale{Eigen::Vector3d::Ones()};
    Eigen::Vector3d offset{Eigen::Vector3d::Zero()};
    Eigen::Matrix3d mount{Eigen::Matrix3d::Identity()};
  };
  struct Destroy {
    void operator()(iio_buffer* buffer) const;
  };
  Device(iio_device* device, std::string name) : device_(device), name_(std::move(name)) {}
  [[nodiscard]] Expected<std::optional<Triad>> find_triad(bool wanted, const char* kind) const;
  [[nodiscard]] Expected<void> enable(const std::optional<Triad>& triad) const;
  [[nodiscard]] Expected<void> set_trigger(const Context& context, const std::string& name) const;
  void set_rate(double rate_hz);
  void set_clock(bool is_local);
  [[nodiscard]] Eigen::Vector3d read(const Triad& triad, std::size_t k) const;

  iio_device* device_;
  std::string name_;
  std::optional<Triad> gyro_;
  std::optional<Triad> accel_;
  iio_channel* stamp_{nullptr};
  bool is_on_our_clock_{false};
  bool is_local_{false};
  std::optional<double> rate_hz_;
  std::unique_ptr<iio_buffer, Destroy> buffer_;
  std::vector<Reading> readings_;
};

}  // namespace fiducap::iio
