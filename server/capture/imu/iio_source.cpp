#include "capture/imu/iio_source.hpp"

#include "base/log.hpp"
#include "base/text.hpp"
#include "capture/imu/device_clock.hpp"
#include "capture/imu/iio_device.hpp"
#include "capture/imu/reading_pairs.hpp"

namespace fiducap {

namespace {

class IioSource final : public SensorSource {
 public:
  /// @param accel  nullopt: the gyro's device has it, too
  IioSource(iio::Context context, iio::Device gyro, std::optional<iio::Device> accel,
            const Clock& clock)
      : context_(std::move(context)),
        gyro_(std::move(gyro)),
        accel_(std::move(accel)),
        clock_(clock) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      if (given_ < waiting_.size()) return waiting_[given_++];
      waiting_.clear();
      given_ = 0;
      const bool reads_gyro = !accel_ || pairs_.gyro_is_behind();
      iio::Device& device = reads_gyro ? gyro_ : *accel_;
      const auto came = device.refill();
      if (!came) return tl::unexpected(came.error());
      if (*came) take(device, reads_gyro);
    }
    return std::nullopt;
  }

 private:
  void take(const iio::Device& device, bool is_gyro) {
    const Instant now = clock_.now();
    for (const auto& reading : device.readings()) {
      if (!accel_) {
        place({reading.stamp_ns, reading.w, reading.f}, now);
      } else if (is_gyro) {
        pairs_.add_gyro({reading.stamp_ns, reading.w});
      } else {
        pairs_.add_accel({reading.stamp_ns, reading.f});
      }
    }
    while (const auto pair = pairs_.take()) place(*pair, now);
  }

  void place(const ReadingPairs::Pair& pair, Instant now) {
    const auto known = gyro_.is_on_our_clock() ? std::optional(Duration{0}) : std::nullopt;
    const auto at = device_clock_.place(static_cast<std::uint64_t>(pair.stamp_ns), now, known);
    if (at) waiting_.push_back(ImuSample{*at, pair.w, pair.f});
  }

  iio::Context context_;  // goes last
  iio::Device gyro_;
  std::optional<iio::Device> accel_;
  const Clock& clock_;
  ReadingPairs pairs_;
  DeviceClock device_clock_{64, 1};
  std::vector<ImuSample> waiting_;
  std::size_t given_{0};
};

}  // namespace

Expected<std::unique_ptr<SensorSource>> open_iio_source(const IioConfig& config,
                                                        const Clock& clock) {
  auto context = iio::Context::open(config.uri);
  if (!context) return tl::unexpected(context.error());
  const auto gyro_device = context->find(config.gyro, "anglvel_x");
  if (!gyro_device) return tl::unexpected(gyro_device.error());
  const auto accel_device = context->find(config.accel, "accel_x");
  if (!accel_device) return tl::unexpected(accel_device.error());
  const bool is_one = *gyro_device == *accel_device;
  auto gyro = iio::Device::open(*context, *gyro_device, {true, is_one}, config);
  if (!gyro) return tl::unexpected(gyro.error());
  std::optional<iio::Device> accel;
  if (!is_one) {
    auto opened = iio::Device::open(*context, *accel_device, {false, true}, config);
    if (!opened) return tl::unexpected(opened.error());
    accel.emplace(std::move(*opened));
  }
  log::info("capture", "IIO: gyro of " + gyro->name() + ", accelerometer of " +
                           (accel ? accel->name() : gyro->name()) +
                           (gyro->rate_hz() ? ", " + fixed(*gyro->rate_hz(), 1) + " Hz" : "") +
                           (gyro->is_on_our_clock() ? ", stamped on this machine's clock"
                                                    : ", stamps placed by arrival"));
  return std::make_unique<IioSource>(std::move(*context), std::move(*gyro), std::move(accel),
                                     clock);
}

}  // namespace fiducap
