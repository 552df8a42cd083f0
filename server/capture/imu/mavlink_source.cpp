#include "capture/imu/mavlink_source.hpp"

#include <algorithm>
#include <chrono>

#include "base/log.hpp"
#include "capture/imu/byte_link.hpp"
#include "capture/imu/link_watch.hpp"
#include "capture/imu/vehicle_imu.hpp"

namespace fiducap {

namespace {

// So long a stop may take to be seen, and what is due to be said.
constexpr Duration kTurn = std::chrono::milliseconds(20);

class MavlinkSource final : public SensorSource {
 public:
  MavlinkSource(ByteLink link, const MavlinkImuConfig& config, const Clock& clock)
      : link_(std::move(link)),
        first_(parse_peer(config.link.peer)),
        vehicle_(config),
        watch_("MAVLink frame", link_.is_serial(), config.link.baud),
        clock_(clock) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      if (auto sample = vehicle_.take()) return *sample;
      const auto piece = link_.read(kTurn);
      if (!piece) return tl::unexpected(piece.error());
      const Instant now = clock_.now();
      take(*piece, now);
      speak(now);
    }
    return std::nullopt;
  }

 private:
  void take(const ByteLink::Piece& piece, Instant now) {
    const auto frames = vehicle_.frames().frames() + vehicle_.frames().others();
    const auto broken = vehicle_.frames().broken();
    vehicle_.receive(piece.bytes, piece.bytes.empty() ? last_ : piece.from, now);
    if (!piece.bytes.empty()) last_ = piece.from;
    const auto printable = std::count_if(piece.bytes.begin(), piece.bytes.end(), is_printable);
    watch_.add(piece.bytes.size(), static_cast<std::size_t>(printable),
               vehicle_.frames().frames() + vehicle_.frames().others() - frames,
               vehicle_.frames().broken() - broken, now);
    if (const auto news = watch_.take_news()) log::warning("capture", link_.name() + ": " + *news);
    while (const auto news = vehicle_.take_news())
      log::write(news->is_bad ? log::Level::kWarning : log::Level::kInfo, "capture",
                 link_.name() + ": " + news->text);
  }

  /// To the vehicle; to the configured address before it has spoken.
  void speak(Instant now) {
    out_.clear();
    if (const auto rival = vehicle_.challenge(now, out_)) link_.write(out_, *rival);
    out_.clear();
    vehicle_.speak(now, out_);
    if (out_.empty()) return;
    const auto to = vehicle_.address(now);
    const bool may_call = link_.is_serial() || (first_ && first_->port > 0);
    if (to || may_call)
      link_.write(out_, to.value_or(first_.value_or(LinkPeer{})), vehicle_.is_proven(now));
  }

  ByteLink link_;
  std::optional<LinkPeer> first_;  ///< Spoken to before anything came.
  mavlink::VehicleImu vehicle_;
  LinkWatch watch_;
  const Clock& clock_;
  LinkPeer last_{};
  std::vector<std::byte> out_;
};

}  // namespace

void MavlinkImuConfig::check(Checker& checker) const {
  constexpr double kBytes = 80;  // of one HIGHRES_IMU with its frame, and a little else
  constexpr double kBits = 10;   // 8N1
  const double needed = rate_hz * kBytes * kBits;
  link.check(checker);
  checker.within("system", system, 0, 255).within("rate_hz", rate_hz, 0, 2000);
  // A USB device takes any rate and is not bound by it; 57600 and 115200 are those of radios and
  // UARTs.
  const bool is_usb = link.device.find("ACM") != std::string::npos ||
                      link.device.find("/usb-") != std::string::npos;
  checker.require(link.device.empty() || is_usb || needed <= link.baud, "rate_hz", rate_hz,
                  "needs " + std::to_string(static_cast<int>(needed)) +
                      " baud, the serial line has " + std::to_string(link.baud) +
                      ": ask for less, or set a higher rate on both sides");
}

Expected<std::unique_ptr<SensorSource>> open_mavlink_source(const MavlinkImuConfig& config,
                                                            const Clock& clock) {
  auto link = ByteLink::open(config.link);
  if (!link) return tl::unexpected(link.error());
  return std::make_unique<MavlinkSource>(std::move(*link), config, clock);
}

}  // namespace fiducap
