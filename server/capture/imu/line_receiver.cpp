#include "capture/imu/line_receiver.hpp"

#include <charconv>
#include <chrono>

#include "base/log.hpp"
#include "base/text.hpp"
#include "capture/imu/byte_link.hpp"
#include "capture/imu/imu_source.hpp"

namespace fiducap {
namespace {

class Fields final {
 public:
  explicit Fields(std::string_view text) : rest_(text) {}

  template <typename T>
  bool read(T& out) {
    return parse_number(next(), out);
  }
  bool read(Eigen::Vector3d& out) {
    return read(out.x()) && read(out.y()) && read(out.z()) && out.allFinite();
  }
  std::string_view next() {
    const auto comma = rest_.find(',');
    const std::string_view field = rest_.substr(0, comma);
    is_over_ = comma == std::string_view::npos;
    rest_.remove_prefix(is_over_ ? rest_.size() : comma + 1);
    return field;
  }
  [[nodiscard]] bool is_over() const { return is_over_; }

 private:
  std::string_view rest_;
  bool is_over_{false};
};

constexpr Duration kSlice = std::chrono::milliseconds(50);
// After this silence another sender is accepted.
constexpr Duration kGivenUp = std::chrono::seconds(5);

class LineSource final : public ByteSource {
 public:
  LineSource(ByteLink link, int baud, const Clock& clock)
      : ByteSource(std::move(link), "line of the IMU protocol", baud, kSlice, clock) {}

 private:
  std::optional<ImuSample> take_sample() override { return receiver_.take(); }

  std::optional<Units> receive(const ByteLink::Piece& piece, Instant now) override {
    if (!piece.bytes.empty() && !is_our_sender(piece.from, now)) return std::nullopt;
    const LineReceiver::Counts before = receiver_.counts();
    receiver_.receive(piece.bytes, now);
    const LineReceiver::Counts& after = receiver_.counts();
    const std::uint64_t lines = after.readings - before.readings + after.triggers - before.triggers;
    if (lines > 0) received_at_ = now;
    return Units{lines, after.wrong_checksums - before.wrong_checksums};
  }

  void finish(Instant) override {
    if (std::exchange(restarts_, receiver_.clock().restarts()) == receiver_.clock().restarts())
      return;
    log::warning("capture", link().name() +
                                ": the clock of the IMU has restarted, and so has the device: "
                                "check its power supply if it was not reset");
  }

  /// The first sender, as long as it sends.
  bool is_our_sender(const net::Peer& from, Instant now) {
    if (from == sender_) return true;
    if (received_at_ && now - *received_at_ < kGivenUp) {
      if (!std::exchange(foreign_reported_, true))
        log::warning("capture", link().name() + ": readings of " + text_of(from) +
                                    " are ignored, because " + text_of(sender_) +
                                    " came first. Set `peer` to choose");
      return false;
    }
    sender_ = from;
    receiver_.restart();
    return true;
  }

  LineReceiver receiver_;
  net::Peer sender_;
  std::optional<Instant> received_at_;
  bool foreign_reported_{false};
  std::uint64_t restarts_{0};
};

}  // namespace

std::variant<ImuLine, TriggerLine, LineFault> parse_line(std::string_view line) {
  const auto star = line.rfind('*');
  if (star == std::string_view::npos || line.size() != star + 3) return LineFault::kForm;
  std::uint8_t checksum = 0;
  const char* end = line.data() + line.size();
  const auto [stopped, failure] = std::from_chars(line.data() + star + 1, end, checksum, 16);
  if (failure != std::errc{} || stopped != end) return LineFault::kForm;
  const std::string_view text = line.substr(0, star);
  // As in NMEA: exclusive or of all characters before the star.
  for (const char c : text)
    checksum = static_cast<std::uint8_t>(checksum ^ static_cast<unsigned char>(c));
  if (checksum != 0) return LineFault::kChecksum;
  Fields fields(text);
  const std::string_view kind = fields.next();
  if (kind == "IMU") {
    ImuLine imu;
    const bool whole = fields.read(imu.count_us) && fields.read(imu.w) && fields.read(imu.f);
    if (whole && fields.is_over()) return imu;
  } else if (kind == "TRG") {
    TriggerLine trigger;
    const bool whole = fields.read(trigger.count_us) && fields.read(trigger.number);
    if (whole && fields.is_over()) return trigger;
  }
  return LineFault::kForm;
}

void LineReceiver::receive(std::span<const std::byte> bytes, Instant arrived) {
  for (const std::byte byte : bytes) {
    const char c = static_cast<char>(byte);
    if (c == '\n') {
      end_line(arrived);
      length_ = 0;
    } else if (length_ < kLongest) {
      line_[length_++] = c;
    } else if (length_ == kLongest) {
      length_ = kUnknown;
      ++counts_.malformed;
    }
  }
}

void LineReceiver::end_line(Instant arrived) {
  if (length_ == kUnknown) return;
  std::string_view line(line_.data(), length_);
  if (line.ends_with('\r')) line.remove_suffix(1);
  if (line.empty()) return;
  if (line.starts_with('#')) {
    ++counts_.comments;
    return;
  }
  const auto parsed = parse_line(line);
  if (const auto* imu = std::get_if<ImuLine>(&parsed)) {
    const auto at = clock_.place(imu->count_us, arrived);
    if (!at) return;
    ++counts_.readings;
    waiting_.push({*at, imu->w, imu->f});
  } else if (const auto* trigger = std::get_if<TriggerLine>(&parsed)) {
    ++counts_.triggers;
    if (const auto at = clock_.time_of(trigger->count_us)) trigger_ = {*at, trigger->number};
  } else {
    const bool is_checksum = std::get<LineFault>(parsed) == LineFault::kChecksum;
    ++(is_checksum ? counts_.wrong_checksums : counts_.malformed);
  }
}

OpenedSource open_line_source(const LinkConfig& config, const Clock& clock) {
  auto link = ByteLink::open(config);
  if (!link) return tl::unexpected(link.error());
  return std::make_unique<LineSource>(std::move(*link), config.baud, clock);
}

}  // namespace fiducap
