// The order of the rooms is a test, not a hope: an earlier room must not include a later one, and
// between the sub-rooms of one room there are only the arrows written down here.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <string>
#include <string_view>

#include "architecture/source_files.hpp"

namespace fiducap::test {
namespace {

namespace fs = std::filesystem;
constexpr std::array<std::string_view, 13> kRooms{
    "base",  "middleware", "capture",     "detection", "estimation", "mapping", "pipeline",
    "scene", "simulation", "calibration", "streaming", "daemon",     "tools"};

/// Sub-room → its neighbours in the same room that it may know. What stands in the room's own
/// folder is open to all its sub-rooms: it is what they share.
const std::map<std::string, std::set<std::string>> kSubRooms{
    {"middleware/mavlink", {"net"}},
    {"middleware/net", {}},
    {"capture/lens", {}},
    {"capture/imu", {"ros"}},
    {"capture/import", {"lens", "recording"}},
    {"capture/recording", {"lens"}},
    {"capture/ros", {"lens"}},
    {"capture/v4l2", {"lens"}},
    {"capture/video", {"lens"}},
    {"detection/points", {}},
    {"detection/sheet", {}},
    {"estimation/imu", {}},
    {"estimation/filter", {}},
    {"estimation/start", {"imu", "filter"}},
    {"estimation/checks", {"imu"}},
    {"estimation/update", {"imu", "filter", "start"}},
    {"estimation/robocentric", {"imu", "filter", "start", "update"}},
    {"estimation/world", {"imu", "filter", "start", "update"}},
    {"estimation/segment", {"imu", "filter", "world"}},
    {"mapping/formats", {}},
    {"mapping/graph", {}},
    {"mapping/store", {}},
    {"pipeline/agreement", {}},
    {"pipeline/replay", {}},
    {"simulation/motion", {}},
    {"simulation/images", {}},
    {"calibration/imu", {}},
    {"calibration/intrinsics", {}},
    {"calibration/extrinsics", {}},
    {"calibration/guided", {"extrinsics", "imu", "intrinsics"}},
    {"streaming/conventions", {}},
    {"streaming/net", {}},
    {"streaming/dds", {"conventions", "net"}},
    {"streaming/mavlink", {"conventions", "net"}},
    {"streaming/native", {"conventions", "net"}},
    {"streaming/natnet", {"conventions", "net"}},
    {"streaming/qualisys", {"conventions", "net"}},
    {"streaming/vicon", {"conventions", "net"}},
    {"streaming/vrpn", {"conventions", "net"}},
    {"streaming/web", {"conventions", "native", "net"}},  // its control channel
    {"daemon/recording", {}},
    {"daemon/config", {"recording"}},
    {"daemon/bodies", {"config", "recording", "views"}},
    {"daemon/views", {}},
    {"daemon/watch", {"bodies"}},
    {"daemon/review", {"bodies", "config"}},
    {"daemon/setup", {"bodies", "config"}},
    {"tools/tags", {}},
    {"tools/plot", {}},
    {"tools/replay", {"plot", "tags"}},
    {"tools/calibrate", {"plot"}},
    {"tools/camera", {}},
    {"tools/import", {}},
    {"tools/live", {}},
    {"tools/doctor", {"live"}},
};

std::ptrdiff_t place(std::string_view room) {
  return std::find(kRooms.begin(), kRooms.end(), room) - kRooms.begin();
}

bool is_room(std::string_view name) { return place(name) < std::ssize(kRooms); }

/// `estimation` and `world` of `estimation/world/filter.hpp`; no sub-room: the second is empty.
std::pair<std::string, std::string> rooms_of(const fs::path& path) {
  auto part = path.begin();
  const std::string room = part->string();
  ++part;
  return {room, std::next(part) == path.end() ? "" : part->string()};
}

TEST(Rooms, IncludeOnlyThemselvesAndRoomsBeforeThem) {
  int includes = 0;
  for (const SourceFile& file : source_files({"server"})) {
    const auto room = rooms_of(file.path.lexically_relative("server")).first;
    EXPECT_TRUE(is_room(room)) << file.path << " is in no room that has a place in the order";
    for (const std::string& line : file.lines) {
      const std::string included = included_by(line);
      if (included.find('/') == std::string::npos) continue;
      const auto other = rooms_of(included).first;
      if (!is_room(other)) continue;
      ++includes;
      EXPECT_LE(place(other), place(room)) << file.path << ": " << line;
    }
  }
  EXPECT_GT(includes, 20) << "the test did not find the sources";
}

TEST(Rooms, SubRoomsKnowOnlyTheNeighboursWrittenDown) {
  std::set<std::string> seen;
  for (const SourceFile& file : source_files({"server"})) {
    const auto [room, sub_room] = rooms_of(file.path.lexically_relative("server"));
    if (sub_room.empty()) continue;
    const std::string name = room + "/" + sub_room;
    seen.insert(name);
    const auto known = kSubRooms.find(name);
    ASSERT_NE(known, kSubRooms.end()) << file.path << ": write down what this sub-room may know";
    for (const std::string& line : file.lines) {
      const std::string included = included_by(line);
      if (included.find('/') == std::string::npos) continue;
      const auto [other_room, other] = rooms_of(included);
      if (other_room != room || other.empty() || other == sub_room) continue;
      EXPECT_TRUE(known->second.contains(other)) << file.path << ": " << line;
    }
  }
  for (const auto& entry : kSubRooms) {
    EXPECT_TRUE(seen.contains(entry.first)) << entry.first << " is gone: strike it out";
  }
}

TEST(Rooms, NoArrowsBetweenSubRoomsFormACircle) {
  for (const auto& [name, neighbours] : kSubRooms) {
    const std::string room = name.substr(0, name.find('/') + 1);
    std::set<std::string> reached;
    std::vector<std::string> to_visit(neighbours.begin(), neighbours.end());
    while (!to_visit.empty()) {
      const std::string next = to_visit.back();
      to_visit.pop_back();
      EXPECT_NE(room + next, name) << name << " knows itself by way of others";
      const auto found = kSubRooms.find(room + next);
      ASSERT_NE(found, kSubRooms.end()) << name << " knows " << next << ", which is not there";
      if (reached.insert(next).second) {
        to_visit.insert(to_visit.end(), found->second.begin(), found->second.end());
      }
    }
  }
}

}  // namespace
}  // namespace fiducap::test
