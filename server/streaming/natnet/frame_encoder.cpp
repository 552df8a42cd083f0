#include "streaming/natnet/frame_encoder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/bytes.hpp"
#include "base/expected.hpp"

namespace fiducap::natnet {

namespace {

// Some clients treat mean error 0 as lost.
constexpr float kLeastMeanError = 1e-6F;
constexpr std::int16_t kTrackingValid = 1;

// One body from 3.0 on: i32 id, f32 position[3], f32 quaternion[4] x y z w, f32 mean error, i16
// params. Older layouts have a count of markers before the mean error.
constexpr std::size_t kRecordSize = 38;
constexpr std::size_t kPosePart = 32;
constexpr std::size_t kErrorPart = 4;

// Empty sections around the rigid bodies: marker sets and other markers before; skeletons,
// (assets,) labeled markers, (force plates,) (devices) after. From 4.1 on: count, size in bytes.
constexpr std::size_t kSectionsBefore = 2;
constexpr std::array<std::size_t, 6> kSectionsAfter{2, 2, 2, 3, 4, 5};  // by FrameLayout
static_assert(kSectionsAfter.size() == static_cast<std::size_t>(FrameLayout::k4_1) + 1);

std::size_t section_header(FrameLayout layout) { return layout >= FrameLayout::k4_1 ? 8 : 4; }

bool usable(const BodyPose& body) {
  return body.valid && body.X_WP.p.allFinite() && body.X_WP.q.coeffs().allFinite();
}

float mean_error_of(const BodyPose& body) {
  const double sigma = body.position_sigma_m();
  return std::isfinite(sigma) ? std::max(kLeastMeanError, static_cast<float>(sigma))
                              : kLeastMeanError;
}

bool wants(const FrameProfile& profile, int id) {
  return profile.selection == nullptr || profile.selection->has(id);
}

void write_body(std::span<const std::byte> record, FrameLayout layout, LittleEndianWriter& out) {
  if (layout >= FrameLayout::k3_0) {
    out.bytes(record);
    return;
  }
  out.bytes(record.first(kPosePart)).i32(0).bytes(record.subspan(kPosePart, kErrorPart));
  if (layout >= FrameLayout::k2_6) out.bytes(record.subspan(kPosePart + kErrorPart));
}

void set_payload_size(std::vector<std::byte>& bytes) {
  const std::size_t payload = bytes.size() - kHeaderSize;
  FIDUCAP_ASSERT(payload <= kMaxPayload);
  bytes[2] = static_cast<std::byte>(payload & 0xff);
  bytes[3] = static_cast<std::byte>(payload >> 8);
}

}  // namespace

FrameEncoder::FrameEncoder(const OutputAxes& axes, WhenInvalid when_invalid, Instant epoch)
    : change_(axes), when_invalid_(when_invalid), epoch_(epoch) {}

void FrameEncoder::load(const SceneFrame& frame, Instant sent_at, std::int16_t bits) {
  number_ = static_cast<std::int32_t>(frame.number & 0x7fffffff);
  const Instant received = std::max(frame.at, frame.published_at);
  const Instant sent = std::max(received, sent_at);
  stamps_ = {to_seconds(frame.at - epoch_), static_cast<float>(to_seconds(sent - frame.at)),
             ticks(frame.at), ticks(received), ticks(sent)};
  bits_ = bits;
  const std::size_t bodies = std::min(frame.bodies.size(), kMaxBodies);
  if (std::exchange(axes_number_, frame.axes) != frame.axes) last_valid_.clear();
  last_valid_.resize(bodies);
  records_.clear();
  record_bytes_.clear();
  for (std::size_t i = 0; i < bodies; ++i) load_body(i, frame.bodies[i]);
  for (auto& encoded : everything_) encoded.fresh = false;
  for (auto& encoded : selections_) encoded.fresh = false;
}

void FrameEncoder::load_body(std::size_t index, const BodyPose& body) {
  LastValid& last = last_valid_[index];
  if (last.id != body.body_id) last = {body.body_id, false, Pose{}, 0};
  const bool valid = usable(body);
  if (valid) last = {body.body_id, true, change_.pose(body.X_WP), mean_error_of(body)};
  if (!valid && when_invalid_ == WhenInvalid::kStop) return;
  const bool shown_valid = valid || (when_invalid_ == WhenInvalid::kHold && last.known);
  write_record(body.body_id, last.X_WP, shown_valid ? last.mean_error : 0.0F, shown_valid);
}

void FrameEncoder::write_record(int id, const Pose& X_CP, float mean_error, bool valid) {
  records_.push_back({id, valid, record_bytes_.size()});
  LittleEndianWriter out(record_bytes_);
  out.i32(id);
  for (const double x : X_CP.p) out.f32(static_cast<float>(x));
  for (const double x : X_CP.q.coeffs()) out.f32(static_cast<float>(x));  // x y z w
  out.f32(mean_error).i16(valid ? kTrackingValid : 0);
}

std::span<const std::byte> FrameEncoder::encode(const FrameProfile& profile) {
  Encoded& encoded = place_for(profile);
  if (!encoded.fresh) {
    encoded.bytes.clear();
    write(profile, encoded.bytes);
    encoded.fresh = true;
  }
  return encoded.bytes;
}

FrameEncoder::Encoded& FrameEncoder::place_for(const FrameProfile& profile) {
  if (profile.selection == nullptr || profile.selection->is_everything())
    return everything_[2 * static_cast<std::size_t>(profile.layout) +
                       (profile.bitstream_changed ? 1 : 0)];
  Encoded* free = nullptr;
  for (auto& encoded : selections_) {
    if (!encoded.fresh) {
      if (free == nullptr) free = &encoded;
    } else if (encoded.layout == profile.layout &&
               encoded.bitstream_changed == profile.bitstream_changed &&
               encoded.selection == *profile.selection) {
      return encoded;
    }
  }
  if (free == nullptr) free = &selections_.emplace_back();
  free->layout = profile.layout;
  free->bitstream_changed = profile.bitstream_changed;
  free->selection = *profile.selection;
  return *free;
}

void FrameEncoder::write(const FrameProfile& profile, std::vector<std::byte>& bytes) const {
  const FrameLayout layout = profile.layout;
  LittleEndianWriter(bytes).u16(static_cast<std::uint16_t>(Message::kFrame)).u16(0).i32(number_);
  LittleEndianWriter(bytes).zeros(kSectionsBefore * section_header(layout));
  write_bodies(profile, bytes);
  LittleEndianWriter(bytes).zeros(kSectionsAfter[static_cast<std::size_t>(layout)] *
                                  section_header(layout));
  write_suffix(profile, bytes);
  set_payload_size(bytes);
}

void FrameEncoder::write_bodies(const FrameProfile& profile, std::vector<std::byte>& bytes) const {
  const FrameLayout layout = profile.layout;
  // 2.5 has no validity bit: invalid bodies are left out.
  const auto shown = [&](const Record& record) {
    return (layout >= FrameLayout::k2_6 || record.valid) && wants(profile, record.id);
  };
  const auto count = std::ranges::count_if(records_, shown);
  LittleEndianWriter out(bytes);
  out.i32(static_cast<std::int32_t>(count));
  if (layout >= FrameLayout::k4_1)
    out.i32(static_cast<std::int32_t>(count) * static_cast<std::int32_t>(kRecordSize));
  const std::span all(record_bytes_);
  if (layout >= FrameLayout::k3_0 && static_cast<std::size_t>(count) == records_.size()) {
    out.bytes(all);
    return;
  }
  for (const Record& record : records_)
    if (shown(record)) write_body(all.subspan(record.at, kRecordSize), layout, out);
}

void FrameEncoder::write_suffix(const FrameProfile& profile, std::vector<std::byte>& bytes) const {
  const FrameLayout layout = profile.layout;
  LittleEndianWriter out(bytes);
  if (layout < FrameLayout::k3_0) out.f32(stamps_.latency_s);
  out.u32(0).u32(0);  // no timecode
  if (layout == FrameLayout::k2_6) out.f32(static_cast<float>(stamps_.seconds));
  if (layout >= FrameLayout::k2_7) out.f64(stamps_.seconds);
  if (layout >= FrameLayout::k3_0)
    out.i64(stamps_.mid_exposure).i64(stamps_.data_received).i64(stamps_.transmit);
  if (layout >= FrameLayout::k4_1)
    out.u32(0).u32(0);  // no PTP time; two clients read other values as params
  const int bits = bits_ | (profile.bitstream_changed ? FrameBits::kBitstreamChanged : 0);
  if (layout >= FrameLayout::k2_6) out.i16(static_cast<std::int16_t>(bits));
  out.i32(0);
}

}  // namespace fiducap::natnet
