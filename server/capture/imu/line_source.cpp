#include "capture/imu/line_source.hpp"

#include <algorithm>
#include <chrono>

#include "base/log.hpp"
#include "capture/imu/byte_link.hpp"
#include "capture/imu/line_receiver.hpp"
#include "capture/imu/link_watch.hpp"

namespace fiducap {

namespace {

constexpr Duration kSlice = std::chrono::milliseconds(50);  // so long a stop may take to be seen
// A sender that is silent for so long gives up its place to another one.
constexpr Duration kGivenUp = std::chrono::seconds(5);

class LineSource final : public SensorSource {
 public:
  LineSource(ByteLink link, int baud, const Clock& clock)
      : link_(std::move(link)),
        watch_("line of the IMU protocol", link_.is_serial(), baud),
        clock_(clock) {}

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    while (!stop.stop_requested()) {
      if (auto sample = receiver_.take()) return *sample;
      const auto piece = link_.read(kSlice);
      if (!piece) return tl::unexpected(piece.error());
      take(*piece, clock_.now());
    }
    return std::nullopt;
  }

 private:
  void take(const ByteLink::Piece& piece, Instant now) {
    if (!piece.bytes.empty() && !is_our_sender(piece.from, now)) return;
    const LineReceiver::Counts before = receiver_.counts();
    receiver_.receive(piece.bytes, now);
    const LineReceiver::Counts& after = receiver_.counts();
    const auto printable = std::count_if(piece.bytes.begin(), piece.bytes.end(), is_printable);
    const std::uint64_t lines = after.readings - before.readings + after.triggers - before.triggers;
    watch_.add(piece.bytes.size(), static_cast<std::size_t>(printable), lines,
               after.wrong_checksums - before.wrong_checksums, now);
    if (lines > 0) spoke_at_ = now;
    if (const auto news = watch_.take_news()) log::warning("capture", link_.name() + ": " + *news);
    if (restarts_ == receiver_.clock().restarts()) return;
    restarts_ = receiver_.clock().restarts();
    log::warning("capture", link_.name() +
                                ": the clock of the IMU has started again: the device "
                                "did, too. Look at its power supply if nobody reset it");
  }

  /// The first one that speaks, as long as it does.
  bool is_our_sender(const LinkPeer& from, Instant now) {
    if (from == sender_) return true;
    if (spoke_at_ && now - *spoke_at_ < kGivenUp) {
      if (++foreign_ == 1)
        log::warning("capture", link_.name() + ": " + text_of(from) +
                                    " sends here, too, and is left "
                                    "out; " +
                                    text_of(sender_) + " came first. Set `peer` to choose");
      return false;
    }
    sender_ = from;
    receiver_.begin_anew();
    return true;
  }

  ByteLink link_;
  LineReceiver receiver_;
  LinkWatch watch_;
  const Clock& clock_;
  LinkPeer sender_;
  std::optional<Instant> spoke_at_;
  std::uint64_t foreign_{0};
  std::uint64_t restarts_{0};
};

}  // namespace

Expected<std::unique_ptr<SensorSource>> open_line_source(const LinkConfig& config,
                                                         const Clock& clock) {
  auto link = ByteLink::open(config);
  if (!link) return tl::unexpected(link.error());
  return std::make_unique<LineSource>(std::move(*link), config.baud, clock);
}

}  // namespace fiducap
