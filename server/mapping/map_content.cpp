// Checks and hash of what a TagMap says; its lookups are in tag_map.cpp.
#include <cmath>
#include <cstddef>
#include <sstream>

#include "base/byte_writer.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

namespace {

// Above this a quaternion was not meant to be one; below it is somebody's rounding.
constexpr double kUnitTolerance = 1e-3;

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::optional<std::string> fault_in(const Pose& pose) {
  if (!pose.p.allFinite()) return "position must be finite";
  if (!(std::abs(pose.q.norm() - 1.0) <= kUnitTolerance)) {
    return "quaternion has length " + number(pose.q.norm()) + ": must be 1";
  }
  return std::nullopt;
}

using Writer = ByteWriter<std::endian::little>;

/// -0 and 0 are the same number to SQLite and to us.
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

std::optional<std::string> fault_in(const MapTag& entry) {
  const KnownTag& tag = entry.tag;
  if (tag.tag_id < 0) return "id = " + std::to_string(tag.tag_id) + ": must be >= 0";
  if (!std::isfinite(tag.edge_m) || tag.edge_m <= 0) {
    return "edge_m = " + number(tag.edge_m) + ": must be finite and > 0";
  }
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

}  // namespace fiducap
