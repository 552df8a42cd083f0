#include "capture/imu/vehicle_imu.hpp"

#include <chrono>
#include <utility>

#include "base/log.hpp"
#include "capture/imu/imu_source.hpp"
#include "middleware/mavlink/frame.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap::mavlink {
namespace {

constexpr Duration kHeartbeatPeriod = std::chrono::seconds(1);
// After this time readings are taken from another message.
constexpr Duration kMessageGone = std::chrono::seconds(1);
// Sending stops when the vehicle has been silent for this long.
constexpr Duration kAddressExpires = std::chrono::seconds(10);
// Plausible offset of an autopilot's clock.
constexpr Duration kFarthestClock{std::int64_t{1} << 61};
// Answers to one piece are limited.
constexpr std::size_t kMostAnswers = 512;

// An answer is valid in the slot of its question and in the next one.
constexpr Duration kSlot = std::chrono::seconds(1);

std::int64_t slot_of(Instant now) { return to_ns(now) / kSlot.count(); }

/// frd → flu.
Eigen::Vector3d flu_of(const Eigen::Vector3d& frd) { return {frd.x(), -frd.y(), -frd.z()}; }

}  // namespace

VehicleImu::VehicleImu(const MavlinkImuConfig& config)
    : config_(config), choice_(config.system), key_(net::random_key()), requests_(config) {}

void VehicleImu::receive(std::span<const std::byte> bytes, const net::Peer& from, Instant arrived) {
  if (from != last_from_) stream_.clear();  // an incomplete frame of the other sender
  last_from_ = from;
  stream_.add(bytes, [&](const Frame& frame) { take_frame(frame, from, arrived); });
}

void VehicleImu::take_frame(const Frame& frame, const net::Peer& from, Instant arrived) {
  const bool may_replace = proven_rival_ == from && !is_proven(arrived);
  const bool is_ours = choice_.accept(frame, from, arrived, may_replace);
  if (auto event = choice_.take_event()) report(std::move(*event));
  if (!is_ours) return take_foreign(frame, from, arrived);
  if (std::exchange(changes_, choice_.changes()) != choice_.changes()) {
    restart();
    report("uses the IMU of " + choice_.text_of_vehicle(), false);
  }
  if (!frame.is(MessageId::kTimesync)) return take_reading(frame, arrived);
  const Timesync timesync = decode_timesync(frame);
  if (timesync.tc1_ns != 0) {
    sync_.accept_reply(timesync, arrived);
  } else if (answers_.size() < kMostAnswers) {
    encode_timesync(next_sender(), {to_ns(arrived), timesync.ts1_ns}, answers_);
  }
}

void VehicleImu::take_foreign(const Frame& frame, const net::Peer& from, Instant arrived) {
  if (is_proven(arrived)) return;
  if (choice_.is_candidate(frame)) rival_ = from;
  if (!frame.is(MessageId::kTimesync)) return;
  const Timesync answer = decode_timesync(frame);
  const std::int64_t slot = slot_of(arrived);
  if (answer.tc1_ns == 0) return;
  if (answer.ts1_ns == number_for(from, slot) || answer.ts1_ns == number_for(from, slot - 1))
    proven_rival_ = from;
}

/// Stateless: forged rivals cannot displace the state of a real one.
std::int64_t VehicleImu::number_for(const net::Peer& rival, std::int64_t slot) const {
  const std::array key{key_[0] ^ static_cast<std::uint64_t>(slot), key_[1]};
  return static_cast<std::int64_t>(net::peer_hash(key, rival) >> 1 | 1);
}

std::optional<net::Peer> VehicleImu::challenge(Instant now, std::vector<std::byte>& out) {
  const auto rival = std::exchange(rival_, std::nullopt);
  if (rival) encode_timesync(next_sender(), {0, number_for(*rival, slot_of(now))}, out);
  return rival;
}

/// The higher the better; 0: not used.
int VehicleImu::rank_of(MessageId message) const {
  if (config_.message != MavlinkImuMessage::kBest)
    return message == message_of(config_.message) ? 1 : 0;
  const bool is_scaled = choice_.vehicle()->autopilot == kArduPilot;
  if (message == MessageId::kHighresImu) return 3;
  if (message == MessageId::kRawImu) return is_scaled ? 2 : 0;
  return message == MessageId::kScaledImu ? 1 : 0;
}

std::optional<Instant> VehicleImu::place(const InertialReading& reading, Instant arrived) {
  DeviceClock& clock = reading.counts_ms ? milliseconds_ : microseconds_;
  const auto offset = sync_.offset(arrived, clock.drift());
  const bool is_sane =
      offset && offset->to_autopilot > -kFarthestClock && offset->to_autopilot < kFarthestClock;
  const auto known = is_sane ? std::optional(-offset->to_autopilot) : std::nullopt;
  const auto at = clock.place(reading.count, arrived, known);
  if (clock.by_arrival() && !std::exchange(foreign_clock_reported_, true))
    report(
        "its readings and its TIMESYNC answers are of different clocks: readings are placed by "
        "arrival");
  if (const auto restarts = microseconds_.restarts() + milliseconds_.restarts();
      std::exchange(restarts_, restarts) != restarts) {
    sync_ = {};
    requests_.restart();
    report("the autopilot has restarted");
  }
  return at;
}

void VehicleImu::take_reading(const Frame& frame, Instant arrived) {
  const auto reading = decode_inertial(frame);
  if (!reading) return;
  const auto message = static_cast<MessageId>(frame.message);
  const int rank = rank_of(message);
  const bool is_worse =
      taken_ && *taken_ != message && rank < rank_of(*taken_) && arrived - taken_at_ < kMessageGone;
  if (rank == 0 || is_worse) {
    ++counts_.other_message;
    return;
  }
  taken_ = message;
  taken_at_ = arrived;
  if (!reading->is_new) {
    ++counts_.repeated;
    return;
  }
  const auto at = place(*reading, arrived);
  if (!at || (last_sampled_ && *at <= *last_sampled_)) return;
  last_sampled_ = at;
  ++counts_.readings;
  requests_.count(arrived);
  waiting_.push({*at, flu_of(reading->w), flu_of(reading->f)});
}

void VehicleImu::restart() {
  rival_.reset();
  proven_rival_.reset();
  sync_ = {};
  requests_.restart();
  microseconds_ = DeviceClock(64, 1000);
  milliseconds_ = DeviceClock(32, 1'000'000);
  restarts_ = 0;
  taken_.reset();
  foreign_clock_reported_ = false;
}

void VehicleImu::append_due(Instant now, std::vector<std::byte>& out) {
  out.insert(out.end(), answers_.begin(), answers_.end());
  answers_.clear();
  if (!next_heartbeat_ || now >= *next_heartbeat_) {
    next_heartbeat_ = now + kHeartbeatPeriod;
    encode_heartbeat(next_sender(), {kOnboardController, kNoAutopilot, kStateActive}, out);
  }
  if (!address(now)) return;
  const auto& vehicle = *choice_.vehicle();
  if (const auto request = sync_.next_request(now)) encode_timesync(next_sender(), *request, out);
  Sender from = next_sender();
  requests_.append_due({vehicle.system, vehicle.component}, vehicle.autopilot, taken_, now, from,
                       out);
  sequence_ = from.sequence;
  if (auto event = requests_.take_event()) report(std::move(*event));
}

std::optional<net::Peer> VehicleImu::address(Instant now) const {
  const auto& vehicle = choice_.vehicle();
  return vehicle && now - vehicle->received_at < kAddressExpires ? std::optional(vehicle->at)
                                                                 : std::nullopt;
}

}  // namespace fiducap::mavlink

namespace fiducap {
namespace {

constexpr Duration kMavlinkPeriod = std::chrono::milliseconds(20);

class MavlinkSource final : public ByteSource {
 public:
  MavlinkSource(ByteLink link, const MavlinkImuConfig& config, const Clock& clock)
      : ByteSource(std::move(link), "MAVLink frame", config.link.baud, kMavlinkPeriod, clock),
        first_(parse_link_peer(config.link.peer)),
        vehicle_(config) {}

 private:
  std::optional<ImuSample> take_sample() override { return vehicle_.take(); }

  std::optional<Units> receive(const ByteLink::Piece& piece, Instant now) override {
    const auto& stream = vehicle_.frames();
    const auto frames = stream.frames() + stream.others();
    const auto broken = stream.broken();
    if (!piece.bytes.empty()) last_ = piece.from;
    vehicle_.receive(piece.bytes, last_, now);
    return Units{stream.frames() + stream.others() - frames, stream.broken() - broken};
  }

  /// Sends to the vehicle, or to the configured address before that has answered.
  void finish(Instant now) override {
    while (const auto event = vehicle_.take_event())
      log::write(event->is_bad ? log::Level::kWarning : log::Level::kInfo, "capture",
                 link().name() + ": " + event->text);
    out_.clear();
    if (const auto rival = vehicle_.challenge(now, out_)) link().write(out_, *rival);
    out_.clear();
    vehicle_.append_due(now, out_);
    if (out_.empty()) return;
    const auto to = vehicle_.address(now);
    const bool may_call = link().is_serial() || (first_ && first_->port > 0);
    if (to || may_call)
      link().write(out_, to.value_or(first_.value_or(net::Peer{})), vehicle_.is_proven(now));
  }

  std::optional<net::Peer> first_;  ///< Configured address.
  mavlink::VehicleImu vehicle_;
  net::Peer last_{};
  std::vector<std::byte> out_;
};

}  // namespace

OpenedSource open_mavlink_source(const MavlinkImuConfig& config, const Clock& clock) {
  auto link = ByteLink::open(config.link);
  if (!link) return tl::unexpected(link.error());
  return std::make_unique<MavlinkSource>(std::move(*link), config, clock);
}

}  // namespace fiducap
