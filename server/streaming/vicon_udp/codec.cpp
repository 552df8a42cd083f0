#include "streaming/vicon_udp/codec.hpp"

#include <algorithm>
#include <utility>

#include "base/bytes.hpp"
#include "streaming/conventions/client_names.hpp"

namespace fiducap::vicon_udp {

namespace {

constexpr std::uint8_t kObject = 0;
constexpr std::uint16_t kObjectBytes = 72;
static_assert(kItemBytes == 3 + kObjectBytes && kObjectBytes == kNameBytes + 6 * sizeof(double));

void write_item(const std::string& name, const Pose& X, LittleEndianWriter& out) {
  out.u8(kObject).u16(kObjectBytes);
  out.text(name).zeros(kNameBytes - name.size());
  for (const double x : X.p) out.f64(x);
  for (const double a : xyz_angles(X.q.normalized().toRotationMatrix())) out.f64(a);
}

}  // namespace

BlockEncoder::BlockEncoder(std::size_t block_bytes, WhenInvalid when_invalid, NameAliases aliases)
    : block_bytes_(block_bytes),
      when_invalid_(when_invalid),
      aliases_(std::move(aliases)),
      axes_(conventions_of("vicon_udp").axes) {}

void BlockEncoder::use(const SceneModel& model) {
  generation_ = model.generation;
  names_ = client_names(model, conventions_of("vicon_udp").names, aliases_);
}

const Pose* BlockEncoder::shown(const BodyPose& body) {
  const bool usable = body.valid && body.X_WP.p.allFinite() && body.X_WP.q.coeffs().allFinite();
  if (usable) pose_ = axes_.pose(body.X_WP);
  if (when_invalid_ != WhenInvalid::kHold) return usable ? &pose_ : nullptr;
  if (usable) return &(held_[body.body_id] = pose_);
  const auto last = held_.find(body.body_id);
  return last == held_.end() ? nullptr : &last->second;
}

std::span<const std::byte> BlockEncoder::encode(const SceneFrame& frame) {
  if (std::exchange(axes_number_, frame.axes) != frame.axes) held_.clear();
  if (names_.empty() || frame.model->generation != generation_) use(*frame.model);
  const std::size_t most = (block_bytes_ - kHeaderBytes) / kItemBytes;
  bytes_.clear();
  std::size_t items = most;  // of the last datagram
  std::size_t begin = 0;     // of the last datagram
  LittleEndianWriter out(bytes_);
  for (std::size_t i = 0; i < std::min(frame.bodies.size(), names_.size()); ++i) {
    const Pose* X = shown(frame.bodies[i]);
    if (X == nullptr) continue;
    if (items == most) {
      out.zeros(bytes_.empty() ? 0 : begin + block_bytes_ - bytes_.size());
      begin = bytes_.size();
      items = 0;
      out.u32(static_cast<std::uint32_t>(frame.number)).u8(0);
    }
    write_item(names_[i], *X, out);
    bytes_[begin + kHeaderBytes - 1] = static_cast<std::byte>(++items);
  }
  if (!bytes_.empty()) out.zeros(begin + block_bytes_ - bytes_.size());
  return bytes_;
}

}  // namespace fiducap::vicon_udp
