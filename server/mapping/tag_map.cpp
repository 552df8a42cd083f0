#include "mapping/tag_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "base/bytes.hpp"
#include "base/numeric.hpp"

namespace fiducap {

namespace {

// In the order of the enums.
constexpr std::array<std::string_view, 4> kTagStates{"local", "calibrated", "surveyed",
                                                     "quarantined"};
constexpr std::array<std::string_view, 3> kTagChanges{"added", "removed", "moved"};

// A length of a quaternion within this of 1 is rounding of the text.
constexpr double kUnitTolerance = 1e-3;
// Smaller differences between versions are not listed.
constexpr double kDiffers_m = 1e-6;
constexpr double kDiffers_rad = 1e-6;

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

int id_of(const MapTag& entry) { return entry.tag.tag_id; }

std::optional<std::string> fault_in(const Pose& pose) {
  if (!pose.p.allFinite()) return "position must be finite";
  if (!(std::abs(pose.q.norm() - 1.0) <= kUnitTolerance))
    return "quaternion has length " + number(pose.q.norm()) + ": must be 1";
  return std::nullopt;
}

using Writer = ByteWriter<std::endian::little>;

/// -0 and 0 are the same number to SQLite and in a hash.
void write_number(Writer& writer, double value) { writer.f64(value + 0.0); }

void write_text(Writer& writer, const std::string& text) { writer.u64(text.size()).text(text); }

void write_pose(Writer& writer, const Pose& pose) {
  for (const double v :
       {pose.p.x(), pose.p.y(), pose.p.z(), pose.q.w(), pose.q.x(), pose.q.y(), pose.q.z()}) {
    write_number(writer, v);
  }
}

void write_tag(Writer& writer, const MapTag& entry) {
  writer.i64(entry.tag.tag_id);
  write_number(writer, entry.tag.edge_m);
  write_pose(writer, entry.tag.X_WT);
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column)
      write_number(writer, entry.tag.covariance(row, column));
  }
  write_text(writer, std::string(name_of(entry.state)));
  writer.i64(entry.first_seen_utc_ns)
      .i64(entry.last_seen_utc_ns)
      .i64(entry.sightings)
      .i64(entry.component);
}

std::uint64_t fnv1a(std::span<const std::byte> bytes) {
  std::uint64_t hash = 0xcbf29ce484222325;
  for (const std::byte b : bytes) hash = (hash ^ std::to_integer<std::uint64_t>(b)) * 0x100000001b3;
  return hash;
}

}  // namespace

std::string_view name_of(TagState state) { return kTagStates[static_cast<std::size_t>(state)]; }

std::optional<TagState> tag_state_from(std::string_view name) {
  const auto* const found = std::find(kTagStates.begin(), kTagStates.end(), name);
  if (found == kTagStates.end()) return std::nullopt;
  return static_cast<TagState>(found - kTagStates.begin());
}

const MapTag* TagMap::find(int tag_id) const {
  const auto found = std::ranges::lower_bound(tags, tag_id, {}, id_of);
  return found != tags.end() && found->tag.tag_id == tag_id ? &*found : nullptr;
}

MapTag* TagMap::find(int tag_id) {
  const MapTag* found = std::as_const(*this).find(tag_id);
  return found == nullptr ? nullptr : &tags[static_cast<std::size_t>(found - tags.data())];
}

MapTag& TagMap::insert(MapTag entry) {
  const auto place = std::ranges::lower_bound(tags, entry.tag.tag_id, {}, id_of);
  return *tags.insert(place, std::move(entry));
}

bool TagMap::has_workspace() const {
  return std::ranges::any_of(tags, [](const MapTag& entry) { return entry.is_usable(); });
}

void TagMap::known_among(const TagObservations& seen, std::vector<KnownTag>& out) const {
  out.clear();
  for (const TagObservation& observation : seen.tags) {
    const MapTag* entry = find(observation.tag_id);
    if (entry != nullptr && entry->is_usable()) out.push_back(entry->tag);
  }
}

std::optional<std::string> fault_in(const MapTag& entry) {
  const KnownTag& tag = entry.tag;
  if (tag.tag_id < 0) return "id = " + std::to_string(tag.tag_id) + ": must be >= 0";
  if (!std::isfinite(tag.edge_m) || tag.edge_m <= 0)
    return "edge_m = " + number(tag.edge_m) + ": must be finite and > 0";
  if (auto fault = fault_in(tag.X_WT)) return fault;
  if (!tag.covariance.allFinite()) return "covariance must be finite";
  if (tag.covariance.diagonal().minCoeff() < 0) return "covariance has a negative variance";
  if (entry.sightings < 0)
    return "sightings = " + std::to_string(entry.sightings) + ": must be >= 0";
  if (entry.component < 0)
    return "component = " + std::to_string(entry.component) + ": must be >= 0";
  return std::nullopt;
}

std::optional<std::string> fault_in(const TagMap& map) {
  if (auto fault = fault_in(map.X_RW)) return "alignment to the room: " + *fault;
  const MapTag* before = nullptr;
  for (const MapTag& entry : map.tags) {
    const std::string name = "tag " + std::to_string(entry.tag.tag_id) + ": ";
    if (auto fault = fault_in(entry)) return name + *fault;
    if (before != nullptr && before->tag.tag_id == entry.tag.tag_id)
      return name + "id is there twice";
    if (before != nullptr && before->tag.tag_id > entry.tag.tag_id)
      return name + "ids must be sorted";
    before = &entry;
  }
  return std::nullopt;
}

std::string content_hash(const TagMap& map) {
  std::vector<std::byte> bytes;
  Writer writer(bytes);
  write_text(writer, map.family);
  writer.u8(map.reference_tag ? 1 : 0).i64(map.reference_tag.value_or(0));
  write_pose(writer, map.X_RW);
  for (const MapTag& entry : map.tags) write_tag(writer, entry);
  return hash_of(bytes);
}

std::string hash_of(std::span<const std::byte> bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string hex;
  const std::uint64_t hash = fnv1a(bytes);
  for (int shift = 60; shift >= 0; shift -= 4) hex += kDigits[(hash >> shift) & 15];
  return hex;
}

std::string_view name_of(TagChange::Kind kind) {
  return kTagChanges[static_cast<std::size_t>(kind)];
}

std::vector<TagChange> diff(const TagMap& before, const TagMap& after) {
  std::vector<TagChange> changes;
  auto b = before.tags.begin();
  auto a = after.tags.begin();
  while (b != before.tags.end() || a != after.tags.end()) {
    if (a == after.tags.end() || (b != before.tags.end() && b->tag.tag_id < a->tag.tag_id)) {
      changes.push_back({b++->tag.tag_id, TagChange::Kind::kRemoved});
    } else if (b == before.tags.end() || a->tag.tag_id < b->tag.tag_id) {
      changes.push_back({a++->tag.tag_id, TagChange::Kind::kAdded});
    } else {
      const double distance = (a->tag.X_WT.p - b->tag.X_WT.p).norm();
      const double angle = angle_between(b->tag.X_WT.q, a->tag.X_WT.q);
      if (distance > kDiffers_m || angle > kDiffers_rad)
        changes.push_back(
            {a->tag.tag_id, TagChange::Kind::kMoved, distance * 1e3, angle * kDegreesPerRadian});
      ++a;
      ++b;
    }
  }
  return changes;
}

Pose fit_yaw_and_shift(std::span<const std::pair<Eigen::Vector3d, Eigen::Vector3d>> points) {
  if (points.empty()) return {};
  Eigen::Vector3d from = Eigen::Vector3d::Zero();
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  for (const auto& [a, b] : points) {
    from += a / static_cast<double>(points.size());
    to += b / static_cast<double>(points.size());
  }
  double sine = 0;
  double cosine = 0;
  for (const auto& [a, b] : points) {
    const Eigen::Vector2d x = (a - from).head<2>();
    const Eigen::Vector2d y = (b - to).head<2>();
    cosine += x.dot(y);
    sine += x.x() * y.y() - x.y() * y.x();
  }
  const bool has_heading = std::hypot(sine, cosine) > 0;
  const Eigen::Quaterniond yaw = exp_so3({0, 0, has_heading ? std::atan2(sine, cosine) : 0.0});
  return {yaw, to - yaw * from};
}

}  // namespace fiducap
