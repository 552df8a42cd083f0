#include "streaming/qualisys/frame_board.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "base/bytes.hpp"
#include "base/numeric.hpp"

namespace fiducap::qualisys {

namespace {

constexpr std::size_t kFrameHeader = kHeaderSize + 16;
constexpr std::size_t kMostPerBody = 104;  // also more than any component's header
constexpr std::uint32_t kCameraTime = 2;   // type of a time code

bool has_bodies(Component c) { return Components::all().has(c); }

/// 2D drop rate and out-of-sync rate after the count.
bool has_rates(Component c) {
  constexpr Components kPoints{Component::k2d,    Component::k2dLin,
                               Component::k3d,    Component::k3dNoLabels,
                               Component::k3dRes, Component::k3dNoLabelsRes};
  return has_bodies(c) || kPoints.has(c);
}

template <class Writer>
void overwrite_u32(std::vector<std::byte>& bytes, std::size_t at, std::uint32_t value) {
  constexpr bool kBig = std::is_same_v<Writer, BigEndianWriter>;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t shift = 8 * (kBig ? 3 - i : i);
    bytes[at + i] = static_cast<std::byte>((value >> shift) & 0xff);
  }
}

template <class Writer>
void end_packet(std::vector<std::byte>& bytes, std::size_t begin, std::uint32_t count) {
  overwrite_u32<Writer>(bytes, begin, static_cast<std::uint32_t>(bytes.size() - begin));
  overwrite_u32<Writer>(bytes, begin + kFrameHeader - 4, count);
}

template <class Writer>
void put(Writer& writer, bool wide, double value) {
  if (wide) {
    writer.f64(value);
  } else {
    writer.f32(static_cast<float>(value));
  }
}

}  // namespace

bool BodyTable::update(const SceneModel& model) {
  if (generation_ == model.generation) return false;
  generation_ = model.generation;
  const auto names = client_names(model, conventions_of("qualisys").names, aliases_);
  for (Entry& entry : entries_) entry.enabled = false;
  index_of_body_.clear();
  for (std::size_t i = 0; i < model.bodies.size(); ++i) {
    const int id = model.bodies[i].id;
    auto entry = std::ranges::find(entries_, id, &Entry::id);
    if (entry == entries_.end()) entry = entries_.insert(entries_.end(), Entry{id, {}, true});
    entry->name = names[i];
    entry->enabled = true;
    index_of_body_.push_back(static_cast<std::size_t>(entry - entries_.begin()));
  }
  return true;
}

void FrameEncoder::begin(const SceneFrame& frame, std::size_t rows,
                         std::span<const std::size_t> row_of_body) {
  time_us_ = static_cast<std::uint64_t>(to_ns(frame.at) / 1000);
  utc_100ns_ = static_cast<std::uint64_t>(frame.utc_ns() / 100);
  number_ = static_cast<std::uint32_t>(frame.number);
  rows_.resize(rows);
  // Only poses of this frame's bodies in the same axes are held.
  const bool same_axes = std::exchange(axes_number_, frame.axes) == frame.axes;
  for (std::size_t i = 0; i < rows; ++i) {
    const bool has_body = std::find(row_of_body.begin(), row_of_body.end(), i) != row_of_body.end();
    if (!hold_ || !has_body || !same_axes) rows_[i].valid = false;
  }
  const std::size_t bodies = std::min(frame.bodies.size(), row_of_body.size());
  for (std::size_t i = 0; i < bodies; ++i) {
    const BodyPose& body = frame.bodies[i];
    if (!body.valid || row_of_body[i] >= rows) continue;
    const Pose X = axes_.pose(body.X_WP);
    if (!X.p.allFinite() || !X.q.coeffs().allFinite()) continue;
    Row& row = rows_[row_of_body[i]];
    row.valid = true;
    row.p_mm = X.p;
    row.R = X.q.toRotationMatrix();
    row.euler_deg = euler_deg(row.R);
    row.sigma_mm = axes_.length({body.position_sigma_m(), 0, 0}).norm();
  }
}

void FrameEncoder::encode(const Profile& profile, EncodedFrame& out) const {
  if (profile.order == std::endian::big) {
    encode_as<BigEndianWriter>(profile, out);
  } else {
    encode_as<LittleEndianWriter>(profile, out);
  }
}

template <class Writer>
std::size_t FrameEncoder::begin_packet(std::vector<std::byte>& bytes) const {
  const std::size_t begin = bytes.size();
  Writer(bytes)
      .u32(0)
      .u32(static_cast<std::uint32_t>(PacketType::kData))
      .u64(time_us_)
      .u32(number_)
      .u32(0);
  return begin;
}

template <class Writer>
void FrameEncoder::encode_as(const Profile& profile, EncodedFrame& out) const {
  out.packet.clear();
  out.split.clear();
  out.datagram_ends.clear();
  out.packet.reserve(kFrameHeader + kMostPerBody * (kComponentWords.size() + 4 * rows_.size()));
  std::uint32_t count = 0;
  begin_packet<Writer>(out.packet);
  for (const auto& [word, c] : kComponentWords) {
    if (!profile.components.has(c)) continue;
    write_component<Writer>(c, profile.wide, out.packet);
    ++count;
  }
  end_packet<Writer>(out.packet, 0, count);
  if (out.packet.size() <= kMaxDatagram) return out.datagram_ends.push_back(out.packet.size());
  split_as<Writer>(profile, out);
}

// A frame too long for one datagram is sent as several with the same number and whole components. A
// component that is too long cannot be sent by UDP.
template <class Writer>
void FrameEncoder::split_as(const Profile& profile, EncodedFrame& out) const {
  for (const auto& [word, c] : kComponentWords) {
    if (!profile.components.has(c)) continue;
    const std::size_t begin = begin_packet<Writer>(out.split);
    write_component<Writer>(c, profile.wide, out.split);
    end_packet<Writer>(out.split, begin, 1);
    if (out.split.size() - begin <= kMaxDatagram) {
      out.datagram_ends.push_back(out.split.size());
    } else {
      out.split.resize(begin);
    }
  }
}

template <class Writer>
void FrameEncoder::write_component(Component component, bool wide,
                                   std::vector<std::byte>& out) const {
  const std::size_t begin = out.size();
  Writer writer(out);
  writer.u32(0).u32(static_cast<std::uint32_t>(component));
  if (has_bodies(component)) {
    writer.u32(static_cast<std::uint32_t>(rows_.size()));
  } else {
    writer.u32(component == Component::kTimecode ? 1 : 0);
  }
  if (has_rates(component)) writer.u16(0).u16(0);
  if (has_bodies(component)) write_bodies(component, wide, writer);
  if (component == Component::kTimecode)
    writer.u32(kCameraTime)
        .u32(static_cast<std::uint32_t>(utc_100ns_ >> 32))
        .u32(static_cast<std::uint32_t>(utc_100ns_));
  overwrite_u32<Writer>(out, begin, static_cast<std::uint32_t>(out.size() - begin));
}

template <class Writer>
void FrameEncoder::write_bodies(Component component, bool wide, Writer& writer) const {
  const bool matrix = component == Component::k6d || component == Component::k6dRes;
  const bool residual = component == Component::k6dRes || component == Component::k6dEulerRes;
  const int numbers = matrix ? 12 : 6;
  for (const Row& row : rows_) {
    if (!row.valid) {
      const int words = (wide ? 2 * numbers : numbers) + (residual ? (wide ? 2 : 1) : 0);
      for (int i = 0; i < words; ++i) writer.u32(0xffffffff);  // QTM's NaN: all bits set
      continue;
    }
    for (const double v : row.p_mm) put(writer, wide, v);
    if (matrix) {
      for (const double v : std::span(row.R.data(), 9))
        put(writer, wide, v);  // Eigen stores by columns too
    } else {
      for (const double v : row.euler_deg) put(writer, wide, v);
    }
    if (!residual) continue;
    writer.f32(static_cast<float>(row.sigma_mm));
    if (wide) writer.u32(0);  // the SDK reads a float where a double has room
  }
}

Eigen::Vector3d euler_deg(const Eigen::Matrix3d& R) { return kDegreesPerRadian * xyz_angles(R); }

void FrameBoard::put(const std::shared_ptr<const SceneFrame>& frame, const BodyTable& bodies) {
  number_ = frame->number;
  frame_ = frame;
  bodies_ = &bodies;
  kept_.clear();
  if (hold_) begin();  // held poses are updated by every frame
}

void FrameBoard::begin() {
  encoder_.begin(*frame_, bodies_->entries().size(), bodies_->index_of_body());
  frame_.reset();
}

std::shared_ptr<const EncodedFrame> FrameBoard::encoded(const Profile& profile) {
  for (const Kept& kept : kept_)
    if (kept.profile == profile) return kept.frame;
  if (frame_ != nullptr) begin();
  auto out = pool_.acquire();
  encoder_.encode(profile, *out);
  kept_.push_back({profile, out});
  return out;
}

}  // namespace fiducap::qualisys
