#include "capture/imu/vehicle_imu.hpp"

#include <chrono>
#include <utility>

#include "middleware/mavlink/messages.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap::mavlink {

namespace {

constexpr Duration kHeartbeatPeriod = std::chrono::seconds(1);
// Then another message may take the place of the one that readings came in.
constexpr Duration kMessageGone = std::chrono::seconds(1);
// Nobody is spoken to for longer than he spoke.
constexpr Duration kListens = std::chrono::seconds(10);
// An autopilot may answer anything.
constexpr Duration kFarthestClock{std::int64_t{1} << 61};
// Answers to one piece: a flood of questions gets no flood of answers.
constexpr std::size_t kMostAnswers = 512;

// An answer to a question counts in the slot of the question and in the next one.
constexpr Duration kSlot = std::chrono::seconds(1);

std::int64_t slot_of(Instant now) { return to_ns(now) / kSlot.count(); }

bool is_message(const Frame& frame, MessageId message) {
  return frame.message == static_cast<std::uint32_t>(message);
}

/// Forward, right, down → forward, left, up.
Eigen::Vector3d flu_of(const Eigen::Vector3d& frd) { return {frd.x(), -frd.y(), -frd.z()}; }

}  // namespace

VehicleImu::VehicleImu(const MavlinkImuConfig& config)
    : config_(config), choice_(config.system), key_(net::random_key()), requests_(config) {}

void VehicleImu::receive(std::span<const std::byte> bytes, const LinkPeer& from, Instant arrived) {
  if (from != last_from_) stream_.clear();  // what waits is the beginning of another one's frame
  last_from_ = from;
  stream_.add(bytes, [&](const Frame& frame) { take_frame(frame, from, arrived); });
}

void VehicleImu::take_frame(const Frame& frame, const LinkPeer& from, Instant arrived) {
  const bool may_replace = proven_rival_ == from && !is_proven(arrived);
  const bool is_ours = choice_.hear(frame, from, arrived, may_replace);
  if (const auto news = choice_.take_news()) tell(*news);
  if (!is_ours) return take_foreign(frame, from, arrived);
  if (std::exchange(turn_, choice_.turn()) != choice_.turn()) {
    begin_anew();
    tell("takes the IMU of " + choice_.text_of_vehicle(), false);
  }
  if (is_message(frame, MessageId::kTimesync)) {
    take_timesync(frame, arrived);
  } else {
    take_reading(frame, arrived);
  }
}

void VehicleImu::take_foreign(const Frame& frame, const LinkPeer& from, Instant arrived) {
  if (is_proven(arrived)) return;
  if (choice_.is_candidate(frame)) rival_ = from;
  if (!is_message(frame, MessageId::kTimesync)) return;
  const Timesync answer = decode_timesync(frame);
  const std::int64_t slot = slot_of(arrived);
  if (answer.tc1_ns == 0) return;
  if (answer.ts1_ns == number_for(from, slot) || answer.ts1_ns == number_for(from, slot - 1))
    proven_rival_ = from;
}

/// Nothing is kept of whom was asked: a flood of forged rivals takes no place of a real one.
std::int64_t VehicleImu::number_for(const LinkPeer& rival, std::int64_t slot) const {
  const std::array key{key_[0] ^ static_cast<std::uint64_t>(slot), key_[1]};
  return static_cast<std::int64_t>(net::peer_hash(key, {rival.address, rival.port}) >> 1 | 1);
}

std::optional<LinkPeer> VehicleImu::challenge(Instant now, std::vector<std::byte>& out) {
  const auto rival = std::exchange(rival_, std::nullopt);
  if (rival) encode_timesync(next_sender(), {0, number_for(*rival, slot_of(now))}, out);
  return rival;
}

void VehicleImu::take_timesync(const Frame& frame, Instant arrived) {
  const Timesync timesync = decode_timesync(frame);
  if (timesync.tc1_ns != 0) {
    sync_.answer(timesync, arrived);
  } else if (answers_.size() < kMostAnswers) {
    encode_timesync(next_sender(), {to_ns(arrived), timesync.ts1_ns}, answers_);
  }
}

/// The higher the better; 0: not to be taken.
int VehicleImu::rank_of(MessageId message) const {
  using Message = MavlinkImuMessage;
  const auto only = [&](Message wanted) { return config_.message == wanted ? 1 : 0; };
  const bool is_best = config_.message == Message::kBest;
  const bool is_scaled = choice_.vehicle()->autopilot == kArduPilot;
  switch (message) {
    case MessageId::kHighresImu:
      return is_best ? 3 : only(Message::kHighres);
    case MessageId::kRawImu:
      return is_best ? (is_scaled ? 2 : 0) : only(Message::kRaw);
    case MessageId::kScaledImu:
      return is_best ? 1 : only(Message::kScaled);
    case MessageId::kScaledImu2:
      return only(Message::kScaled2);
    case MessageId::kScaledImu3:
      return only(Message::kScaled3);
    default:
      return 0;
  }
}

bool VehicleImu::is_taken(MessageId message, Instant arrived) {
  const int rank = rank_of(message);
  if (rank == 0) return false;
  if (taken_ && *taken_ != message && rank < rank_of(*taken_) && arrived - taken_at_ < kMessageGone)
    return false;
  taken_ = message;
  taken_at_ = arrived;
  return true;
}

void VehicleImu::take_reading(const Frame& frame, Instant arrived) {
  const auto reading = decode_inertial(frame);
  if (!reading) return;
  if (!is_taken(static_cast<MessageId>(frame.message), arrived)) {
    ++counts_.other_message;
    return;
  }
  if (!reading->is_new) {
    ++counts_.repeated;
    return;
  }
  DeviceClock& clock = reading->counts_ms ? milliseconds_ : microseconds_;
  const auto offset = sync_.offset(arrived, clock.drift());
  const bool is_sane =
      offset && offset->to_autopilot > -kFarthestClock && offset->to_autopilot < kFarthestClock;
  const auto known = is_sane ? std::optional(-offset->to_autopilot) : std::nullopt;
  const auto at = clock.place(reading->count, arrived, known);
  if (clock.by_arrival() && !std::exchange(told_foreign_clock_, true))
    tell(
        "its readings are not stamped with the clock that it answers TIMESYNC with: "
        "they are placed by arrival");
  if (const auto restarts = microseconds_.restarts() + milliseconds_.restarts();
      std::exchange(restarts_, restarts) != restarts) {
    sync_ = {};
    requests_.begin_anew();
    tell("the autopilot's clock has started again: it has restarted");
  }
  if (!at || (last_sampled_ && *at <= *last_sampled_)) return;
  last_sampled_ = at;
  ++counts_.readings;
  requests_.count(arrived);
  waiting_.push_back({*at, flu_of(reading->w), flu_of(reading->f)});
}

void VehicleImu::begin_anew() {
  rival_.reset();
  proven_rival_.reset();
  sync_ = {};
  requests_.begin_anew();
  microseconds_ = DeviceClock(64, 1000);
  milliseconds_ = DeviceClock(32, 1'000'000);
  restarts_ = 0;
  taken_.reset();
  told_foreign_clock_ = false;
}

std::optional<ImuSample> VehicleImu::take() {
  if (given_ == waiting_.size()) {
    waiting_.clear();
    given_ = 0;
    return std::nullopt;
  }
  return waiting_[given_++];
}

/// As another part of the vehicle.
Sender VehicleImu::next_sender() {
  const auto& vehicle = choice_.vehicle();
  const int system = vehicle ? vehicle->system : config_.system > 0 ? config_.system : 1;
  return {static_cast<std::uint8_t>(system), kOnboardComputer, sequence_++};
}

void VehicleImu::speak(Instant now, std::vector<std::byte>& out) {
  out.insert(out.end(), answers_.begin(), answers_.end());
  answers_.clear();
  if (!next_heartbeat_ || now >= *next_heartbeat_) {
    next_heartbeat_ = now + kHeartbeatPeriod;
    encode_heartbeat(next_sender(), {kOnboardController, kNoAutopilot, kStateActive}, out);
  }
  if (!address(now)) return;
  const auto& vehicle = *choice_.vehicle();
  if (const auto question = sync_.question(now)) encode_timesync(next_sender(), *question, out);
  Sender from = next_sender();
  requests_.append_due({vehicle.system, vehicle.component}, vehicle.autopilot, taken_, now, from,
                       out);
  sequence_ = from.sequence;
  if (const auto news = requests_.take_news()) tell(*news);
}

std::optional<LinkPeer> VehicleImu::address(Instant now) const {
  const auto& vehicle = choice_.vehicle();
  return vehicle && now - vehicle->heard_at < kListens ? std::optional(vehicle->at) : std::nullopt;
}

void VehicleImu::tell(const std::string& text, bool is_bad) {
  News& news = news_.emplace_back();
  news.text = text;
  news.is_bad = is_bad;
}

std::optional<VehicleImu::News> VehicleImu::take_news() {
  if (news_.empty()) return std::nullopt;
  News first = std::move(news_.front());
  news_.erase(news_.begin());
  return first;
}

}  // namespace fiducap::mavlink
