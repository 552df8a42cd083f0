#include "capture/imu/line_receiver.hpp"

#include <charconv>
#include <cmath>

namespace fiducap {

namespace {

/// Fields between commas, read one after the other.
class Fields final {
 public:
  explicit Fields(std::string_view text) : rest_(text) {}

  template <typename T>
  bool read(T& out) {
    const std::string_view field = next();
    const char* end = field.data() + field.size();
    const auto [stopped, failure] = std::from_chars(field.data(), end, out);
    return failure == std::errc{} && stopped == end;
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

/// Of NMEA: all characters before the star, exclusive or.
std::uint8_t line_checksum(std::string_view text) {
  std::uint8_t sum = 0;
  for (const char c : text) sum = static_cast<std::uint8_t>(sum ^ static_cast<unsigned char>(c));
  return sum;
}

}  // namespace

std::variant<ImuLine, TriggerLine, LineFault> parse_line(std::string_view line) {
  const auto star = line.rfind('*');
  if (star == std::string_view::npos || line.size() != star + 3) return LineFault::kForm;
  std::uint8_t told = 0;
  const char* end = line.data() + line.size();
  const auto [stopped, failure] = std::from_chars(line.data() + star + 1, end, told, 16);
  if (failure != std::errc{} || stopped != end) return LineFault::kForm;
  const std::string_view text = line.substr(0, star);
  if (line_checksum(text) != told) return LineFault::kChecksum;
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
    waiting_.push_back({*at, imu->w, imu->f});
  } else if (const auto* trigger = std::get_if<TriggerLine>(&parsed)) {
    ++counts_.triggers;
    if (const auto at = clock_.time_of(trigger->count_us)) trigger_ = {*at, trigger->number};
  } else {
    const bool checksum = std::get<LineFault>(parsed) == LineFault::kChecksum;
    ++(checksum ? counts_.wrong_checksums : counts_.malformed);
  }
}

std::optional<ImuSample> LineReceiver::take() {
  if (taken_ == waiting_.size()) {
    waiting_.clear();
    taken_ = 0;
    return std::nullopt;
  }
  return waiting_[taken_++];
}

}  // namespace fiducap
