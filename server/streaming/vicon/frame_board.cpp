#include "streaming/vicon/frame_board.hpp"

#include <cmath>
#include <span>
#include <utility>

#include "base/pose.hpp"

namespace fiducap::vicon {

namespace {

constexpr std::int64_t kNumbers = std::int64_t{1} << 31;
// Frames are often late, rarely early: from a quarter of a period early to three quarters late.
constexpr double kEarly = 0.25;

// A pose this uncertain has quality one half.
constexpr double kHalfGood_m = 0.02;
constexpr double kHalfGood_rad = 0.02;

// A packet that leaves later than this after the update is composed again, with its latency.
constexpr Duration kFresh = std::chrono::microseconds(500);

const std::vector<std::uint32_t>* wanted_of(const Profile& profile, Type type) {
  const auto entry = profile.filter.find(type);
  return entry == profile.filter.end() ? nullptr : &entry->second;
}

double fastest_camera_hz(const SceneFrame& frame) {
  double fastest = 0;
  for (const BodyPose& body : frame.bodies) fastest = std::max(fastest, body.image_rate_hz);
  return fastest;
}

Duration not_negative(Duration d) { return std::max(d, Duration::zero()); }

}  // namespace

std::uint32_t FrameNumbers::next(Instant at, double rate_hz) {
  if (!start_ || rate_hz != rate_hz_) {
    start_ = at;
    rate_hz_ = rate_hz;
    first_ = next_;
  }
  const auto ticks =
      static_cast<std::int64_t>(std::floor(to_seconds(at - *start_) * rate_hz + kEarly));
  const std::int64_t number = std::max(next_, first_ + ticks);
  next_ = number + 1;
  return static_cast<std::uint32_t>(number % kNumbers);
}

Instant FrameNumbers::due() const {
  return *start_ + from_seconds(static_cast<double>(next_ - 1 - first_) / rate_hz_);
}

double quality_of(const BodyPose& body) {
  if (!body.valid) return 0.0;
  const double worst =
      std::max(body.position_sigma_m() / kHalfGood_m, body.rotation_sigma_rad() / kHalfGood_rad);
  return std::isfinite(worst) ? 1.0 / (1.0 + worst * worst) : 0.0;
}

void SubjectPoses::update(const SceneFrame& frame) {
  if (std::exchange(axes_number_, frame.axes) != frame.axes) held_.clear();
  all_.resize(frame.bodies.size());
  for (std::size_t i = 0; i < all_.size(); ++i) show(frame.bodies[i], all_[i]);
}

void SubjectPoses::show(const BodyPose& body, SubjectPose& out) {
  const Pose X = axes_.pose(body.X_WP);
  // Clients do not check for NaN.
  const bool usable = body.valid && X.p.allFinite() && X.q.coeffs().allFinite();
  out.listed = usable || when_invalid_ != WhenInvalid::kStop;
  out.visible = usable;
  out.quality = usable ? quality_of(body) : 0.0;
  out.segment.subject = static_cast<std::uint32_t>(body.body_id);
  if (usable) {
    const Eigen::Quaterniond q = X.q.normalized();
    out.segment.t_mm = X.p;
    out.segment.R = q.toRotationMatrix();
    out.segment.rotation_vector = log_so3(q);
  }
  if (when_invalid_ != WhenInvalid::kHold) return;
  if (usable) {
    held_[body.body_id] = out.segment;
  } else if (const auto last = held_.find(body.body_id); last != held_.end()) {
    out.segment = last->second;
    out.visible = true;
  }
}

FrameBoard::FrameBoard(WhenInvalid when_invalid, NameAliases aliases)
    : poses_(conventions_of("vicon").axes, when_invalid), aliases_(std::move(aliases)) {}

void FrameBoard::update(const SceneFrame& frame, Instant now) {
  poses_.update(frame);
  id_ = numbers_.next(frame.at, frame.rate_hz);
  hardware_number_ = static_cast<std::uint32_t>(frame.number);
  timecode_ = timecode_of(to_ns(numbers_.due()) + frame.utc_offset.count(), frame.rate_hz);
  camera_hz_ = fastest_camera_hz(frame);
  made_ = not_negative(frame.published_at - frame.at);
  offered_ = not_negative(now - frame.published_at);
  updated_at_ = now;
  ready_.clear();
  for (std::size_t i = 0; i < kOffered.size(); ++i)
    encoded_[i] = encoded_[i] && is_static(kOffered[i]);
  refresh_statics(frame);
}

/// The static objects are encoded again when the model, the rate or the listed bodies change.
void FrameBoard::refresh_statics(const SceneFrame& frame) {
  const auto& all = poses_.all();
  bool same = statics_version_ != 0 && frame.model->generation == generation_ &&
              frame.rate_hz == rate_hz_ && listed_.size() == all.size();
  for (std::size_t i = 0; same && i < all.size(); ++i) same = listed_[i] == all[i].listed;
  if (same) return;
  ++statics_version_;
  generation_ = frame.model->generation;
  rate_hz_ = frame.rate_hz;
  listed_.clear();
  for (const SubjectPose& pose : all) listed_.push_back(pose.listed);
  const std::vector<std::string> names =
      client_names(*frame.model, conventions_of("vicon").names, aliases_);
  subjects_.clear();
  const std::size_t count = std::min(names.size(), listed_.size());
  for (std::size_t i = 0; i < count; ++i) {
    if (listed_[i])
      subjects_.push_back({static_cast<std::uint32_t>(frame.model->bodies[i].id), names[i]});
  }
  encoded_.fill(false);
}

const ObjectRun& FrameBoard::run_of(Type type) {
  const std::size_t i = *index_of(static_cast<std::uint32_t>(type));
  if (!encoded_[i]) {
    runs_[i].clear();
    encode(type, runs_[i]);
    encoded_[i] = true;
  }
  return runs_[i];
}

void FrameBoard::encode(Type type, ObjectRun& run) const {
  if (is_per_subject(type)) return encode_per_subject(type, run);
  encode_once(type, run.bytes);
  if (!run.bytes.empty()) run.finish();
}

void FrameBoard::encode_once(Type type, std::vector<std::byte>& out) const {
  switch (type) {
    case Type::kApplicationInfo:
      return encode_application_info(out);
    case Type::kStreamInfo:
      return encode_stream_info(rate_hz_, out);
    case Type::kFrameInfo:
      return encode_number(type, id_, out);
    case Type::kHardwareFrameInfo:
      return encode_number(type, hardware_number_, out);
    case Type::kTimecode:
      return encode_timecode(timecode_, out);
    case Type::kFrameRateInfo: {
      const std::array<NamedValue, 2> rates{{{"Camera", camera_hz_}, {"Stream", rate_hz_}}};
      return encode_named(type, rates, out);
    }
    default:
      return;  // contents and latency are written per packet; a ping is not part of a frame
  }
}

void FrameBoard::encode_per_subject(Type type, ObjectRun& run) const {
  const auto each_subject = [&](auto&& one) {
    for (const Subject& subject : subjects_) {
      one(subject);
      run.finish(subject.id);
    }
  };
  const auto each_pose = [&](auto&& shown, auto&& one) {
    for (const SubjectPose& pose : poses_.all()) {
      if (!shown(pose)) continue;
      one(pose);
      run.finish(pose.segment.subject);
    }
  };
  const auto listed = [](const SubjectPose& p) { return p.listed; };
  const auto visible = [](const SubjectPose& p) { return p.visible; };
  auto& out = run.bytes;
  switch (type) {
    case Type::kSubjectInfo:
      return each_subject([&](const Subject& s) { encode_subject_info(s.id, s.name, out); });
    case Type::kSubjectTopology:
      return each_subject([&](const Subject& s) { encode_subject_topology(s.id, out); });
    case Type::kSubjectScale:
      return each_subject([&](const Subject& s) { encode_subject_scale(s.id, out); });
    case Type::kLightweightSegments:
      return each_pose(visible,
                       [&](const SubjectPose& p) { encode_lightweight_segments(p.segment, out); });
    case Type::kObjectQuality:
      return each_pose(listed, [&](const SubjectPose& p) {
        encode_object_quality(p.segment.subject, p.quality, out);
      });
    default:
      return each_pose(visible,
                       [&](const SubjectPose& p) { encode_segments(type, p.segment, out); });
  }
}

net::SharedBytes FrameBoard::packet(const std::shared_ptr<const Profile>& profile, bool statics,
                                    Instant now) {
  const Duration waited = not_negative(now - updated_at_);
  const bool late = waited > kFresh;
  if (!late) {
    for (const Ready& one : ready_)
      if (one.statics == statics && one.profile == profile) return one.bytes;
  }
  auto bytes = packets_.acquire();
  compose(*profile, statics, late ? waited : Duration::zero(), *bytes);
  net::SharedBytes shared = std::move(bytes);
  if (!late) ready_.push_back({profile, statics, shared});
  return shared;
}

void FrameBoard::compose(const Profile& profile, bool statics, Duration waited,
                         std::vector<std::byte>& out) {
  out.clear();
  const std::size_t opened = open_packet(out);
  append_contents(profile, statics, out);
  const auto append = [&](bool static_ones) {
    for (const Type type : kOffered) {
      if (is_static(type) == static_ones && profile.types.has(type))
        run_of(type).append_to(out, wanted_of(profile, type));
    }
  };
  if (statics) append(true);
  append(false);
  if (profile.types.has(Type::kLatencyInfo)) {
    const std::array<NamedValue, 2> samples{
        {{"Frame", to_seconds(made_)}, {"Output", to_seconds(offered_ + waited)}}};
    encode_named(Type::kLatencyInfo, samples, out);
  }
  close_packet(opened, out);
}

void FrameBoard::append_contents(const Profile& profile, bool statics,
                                 std::vector<std::byte>& out) {
  std::array<std::pair<Type, std::uint32_t>, kOffered.size()> counts;
  std::array<Type, kOffered.size()> unchanged;
  std::size_t n_counts = 0;
  std::size_t n_unchanged = 0;
  for (const Type type : kOffered) {
    if (type == Type::kContents || !profile.types.has(type)) continue;
    const bool left_out = is_static(type) && !statics;
    std::uint32_t n = left_out ? 0 : run_of(type).count(wanted_of(profile, type));
    if (type == Type::kLatencyInfo) n = 1;
    counts[n_counts++] = {type, n};
    if (n == 0 && !statics && is_kept_by_clients(type)) unchanged[n_unchanged++] = type;
  }
  encode_contents(std::span(counts).first(n_counts), std::span(unchanged).first(n_unchanged), out);
}

}  // namespace fiducap::vicon
