#include "streaming/native/frames.hpp"

#include <google/protobuf/arena.h>

#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "base/expected.hpp"
#include "fiducap/v1/envelope.pb.h"

namespace fiducap::native {

namespace {

// Bytes for bodies in a Frame datagram. Header: protocol 5, envelope 3, session 9, number
// 11, parts 4 × 4, three times 9, rate 5, versions 2 × 11, profile 6, step 11 = 115 bytes at most.
constexpr std::size_t kFrameBudget = kMaxDatagram - 120;

static_assert(static_cast<int>(BodyState::kLost) == v1::Body::STATE_LOST);

// False for NaN and for values that are infinite as float.
template <typename Derived>
bool is_sane(const Eigen::MatrixBase<Derived>& numbers) {
  constexpr double kLargest = 1e30;
  return (numbers.array().abs() < kLargest).all();
}

// Without the covariance between pose and motion, which is not sent.
bool is_sane(const BodyPose& body) {
  return is_sane(body.X_WP.p) && is_sane(body.X_WP.q.coeffs()) && is_sane(body.v_WP) &&
         is_sane(body.w_WP_P) && is_sane(body.a_WP) &&
         is_sane(body.covariance.topLeftCorner<6, 6>()) &&
         is_sane(body.covariance.diagonal().tail<6>());
}

void put(const Eigen::Vector3d& in, v1::Vector3f& out) {
  out.set_x(static_cast<float>(in.x()));
  out.set_y(static_cast<float>(in.y()));
  out.set_z(static_cast<float>(in.z()));
}

float worst_sigma(const Eigen::Vector3d& variances) {
  return static_cast<float>(std::sqrt(std::max(0.0, variances.maxCoeff())));
}

void put_covariance(const BodyPose& body, v1::Body& out) {
  auto& upper = *out.mutable_pose_covariance();
  upper.Reserve(21);
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column)
      upper.AddAlreadyReserved(static_cast<float>(body.covariance(row, column)));
  }
}

void put_pose(const BodyPose& body, v1::Body& out) {
  auto& position = *out.mutable_position();
  position.set_x(body.X_WP.p.x());
  position.set_y(body.X_WP.p.y());
  position.set_z(body.X_WP.p.z());
  auto& orientation = *out.mutable_orientation();
  orientation.set_w(body.X_WP.q.w());
  orientation.set_x(body.X_WP.q.x());
  orientation.set_y(body.X_WP.q.y());
  orientation.set_z(body.X_WP.q.z());
  put(body.v_WP, *out.mutable_velocity());
  put(body.w_WP_P, *out.mutable_body_rate());
  put(body.a_WP, *out.mutable_acceleration());
  out.set_position_sigma(worst_sigma(body.covariance.diagonal().segment<3>(0)));
  out.set_rotation_sigma(worst_sigma(body.covariance.diagonal().segment<3>(3)));
  out.set_velocity_sigma(worst_sigma(body.covariance.diagonal().segment<3>(6)));
  out.set_rate_sigma(worst_sigma(body.covariance.diagonal().segment<3>(9)));
}

void put(const BodyPose& body, const Profile& profile, v1::Body& out) {
  const bool valid = body.valid && is_sane(body);
  out.set_id(static_cast<std::uint32_t>(body.body_id));
  out.set_state(static_cast<v1::Body::State>(body.state));
  out.set_valid(valid);
  out.set_age_ns(body.age.count());
  out.set_tags_in_view(static_cast<std::uint32_t>(std::max(0, body.tags_in_view)));
  if (!valid) return;
  const bool turned = profile.axes.up != UpAxis::kZ || profile.axes.units_per_m != 1.0;
  const BodyPose changed = turned ? to_client(body, profile.axes) : body;
  put_pose(changed, out);
  if (profile.covariance) put_covariance(changed, out);
}

}  // namespace

std::uint64_t step_of(const Profile& profile, double rate_hz) {
  // A rate of 200.0001 Hz must not halve what a client of at most 100 Hz gets.
  constexpr double kTolerance = 1e-3;
  if (!(profile.max_rate_hz > 0) || !(rate_hz > profile.max_rate_hz)) return 1;
  const double step = std::ceil(rate_hz / static_cast<double>(profile.max_rate_hz) - kTolerance);
  return static_cast<std::uint64_t>(std::clamp(step, 1.0, 1e6));
}

std::vector<std::uint32_t> chosen_bodies(const Profile& profile, const SceneModel& model) {
  std::vector<std::uint32_t> chosen;
  for (std::size_t i = 0; i < model.bodies.size(); ++i) {
    const bool wanted =
        profile.bodies.empty() ||
        std::binary_search(profile.bodies.begin(), profile.bodies.end(), model.bodies[i].name);
    if (wanted) chosen.push_back(static_cast<std::uint32_t>(i));
  }
  return chosen;
}

std::string text_of(const Profile& profile) {
  std::string text =
      fmt::format("{} {}", name_of(profile.axes.up), profile.axes.units_per_m == 1.0 ? "m" : "mm");
  if (profile.axes.up != UpAxis::kZ && profile.axes.scope == AxesScope::kWorldAndBody)
    text += ", bodies turned";
  if (profile.max_rate_hz > 0) text += fmt::format(", at most {:g} Hz", profile.max_rate_hz);
  if (!profile.bodies.empty()) text += fmt::format(", {} chosen", profile.bodies.size());
  if (!profile.covariance) text += ", no covariance";
  return text;
}

/// The messages of one frame on an arena with one block, which grows to the largest frame.
class FrameEncoder::Messages final {
 public:
  struct Part {
    v1::Envelope* envelope;
    std::size_t size;
  };

  Messages(std::uint64_t session, GrantedProfile granted)
      : session_(session), granted_(std::move(granted)) {}

  std::span<const Part> build(const SceneFrame& frame, std::span<const std::uint32_t> chosen,
                              std::uint64_t step) {
    start();
    parts_.clear();
    std::size_t used = kFrameBudget + 1;  // over the budget: the first body opens the first part
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      auto* body = google::protobuf::Arena::CreateMessage<v1::Body>(arena_.get());
      put(frame.bodies[chosen[i]], granted_.profile, *body);
      const std::size_t size = body->ByteSizeLong() + 3;  // with tag and length
      if (used + size > kFrameBudget) {
        open_part(frame, i);
        used = 0;
      }
      used += size;
      parts_.back().envelope->mutable_frame()->mutable_bodies()->UnsafeArenaAddAllocated(body);
    }
    if (parts_.empty()) open_part(frame, 0);
    for (auto& part : parts_) {
      auto& out = *part.envelope->mutable_frame();
      out.set_part_count(static_cast<std::uint32_t>(parts_.size()));
      out.set_body_count(static_cast<std::uint32_t>(chosen.size()));
      if (step != 1) out.set_step(static_cast<std::uint32_t>(step));
      part.size = part.envelope->ByteSizeLong();
    }
    return parts_;
  }

 private:
  void start() {
    if (arena_) {
      const auto needed = static_cast<std::size_t>(arena_->SpaceAllocated());
      arena_->Reset();
      if (needed <= block_.size()) return;
      arena_.reset();
      block_.resize(2 * needed);
    }
    google::protobuf::ArenaOptions options;
    options.initial_block = block_.data();
    options.initial_block_size = block_.size();
    arena_ = std::make_unique<google::protobuf::Arena>(options);
  }
  void open_part(const SceneFrame& frame, std::size_t first_body) {
    auto* envelope = google::protobuf::Arena::CreateMessage<v1::Envelope>(arena_.get());
    envelope->set_protocol(kProtocol);
    auto& out = *envelope->mutable_frame();
    out.set_session(session_);
    out.set_number(frame.number);
    out.set_at_ns(to_ns(frame.at));
    out.set_published_at_ns(to_ns(frame.published_at));
    out.set_utc_offset_ns(frame.utc_offset.count());
    out.set_rate_hz(static_cast<float>(frame.rate_hz));
    out.set_map_version(frame.map ? frame.map->version : 0);
    out.set_model_generation(frame.model->generation);
    out.set_profile(granted_.number);
    out.set_part_index(static_cast<std::uint32_t>(parts_.size()));
    out.set_first_body(static_cast<std::uint32_t>(first_body));
    parts_.push_back({envelope, 0});
  }

  std::uint64_t session_;
  GrantedProfile granted_;
  std::vector<char> block_ = std::vector<char>(16 * 1024);
  std::unique_ptr<google::protobuf::Arena> arena_;
  std::vector<Part> parts_;
};

FrameEncoder::FrameEncoder(std::uint64_t session, const GrantedProfile& profile)
    : messages_(std::make_unique<Messages>(session, profile)) {}

FrameEncoder::~FrameEncoder() = default;

std::span<const std::span<const std::byte>> FrameEncoder::encode(
    const SceneFrame& frame, std::span<const std::uint32_t> chosen, std::uint64_t step) {
  FIDUCAP_ASSERT(frame.model != nullptr && chosen.size() <= kMaxBodies);
  const auto parts = messages_->build(frame, chosen, step);
  FIDUCAP_ASSERT(parts.size() <= kMaxParts);
  bytes_.resize(parts.size() * kMaxDatagram);
  datagrams_.clear();
  std::byte* at = bytes_.data();
  for (const auto& part : parts) {
    FIDUCAP_ASSERT(part.size <= kMaxDatagram);
    part.envelope->SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(at));
    datagrams_.emplace_back(at, part.size);
    at += kMaxDatagram;
  }
  return datagrams_;
}

std::span<const std::span<const std::byte>> FrameEncoder::encode(const SceneFrame& frame) {
  all_.resize(frame.bodies.size());
  std::iota(all_.begin(), all_.end(), 0u);
  return encode(frame, all_);
}

}  // namespace fiducap::native
