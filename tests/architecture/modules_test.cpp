// The order of modules: a module includes itself and earlier ones. Its folders include each other
// only as listed here.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "architecture/source_files.hpp"

namespace fiducap::test {
namespace {

namespace fs = std::filesystem;
constexpr std::array<std::string_view, 13> kModules{
    "base",  "middleware", "capture",     "detection", "estimation", "mapping", "pipeline",
    "scene", "simulation", "calibration", "streaming", "daemon",     "tools"};

/// Module → its folders, each with the other folders of the module in brackets that it may include.
/// Files directly in the module are open to all its folders.
const std::map<std::string, std::string> kListed{
    {"middleware", "mavlink[net] net"},
    {"capture",
     "lens imu[ros] import[lens recording] recording[lens] ros[lens] v4l2[lens] "
     "video[lens]"},
    {"detection", "points sheet"},
    {"estimation",
     "imu filter start[imu filter] world[imu filter start] "
     "rcars[imu filter start] update[imu filter start world] "
     "segment[imu filter world]"},
    {"mapping", "formats graph store"},
    {"pipeline", "replay"},
    {"simulation", "motion images"},
    {"calibration", "imu intrinsics extrinsics guided[extrinsics imu intrinsics]"},
    {"streaming",
     "conventions net dds[conventions net] mavlink[conventions net] "
     "native[conventions net] natnet[conventions net] qualisys[conventions net] "
     "vicon[conventions net] vicon_udp[conventions net] vrpn[conventions net] web[conventions "
     "native net]"},
    {"daemon",
     "recording config[recording] bodies[config recording views] "
     "views watch[bodies] review[bodies config] setup[bodies config]"},
    {"tools",
     "tags plot replay[plot tags] calibrate[plot replay] camera import[replay] live[tags] "
     "doctor[live]"}};

/// `estimation/start` → `imu`, `filter`.
const std::map<std::string, std::set<std::string>> kFolders = [] {
  static const std::regex kFolder(R"((\w+)(?:\[([\w ]*)\])?)");
  std::map<std::string, std::set<std::string>> folders;
  for (const auto& [module, text] : kListed) {
    for (std::sregex_iterator it(text.begin(), text.end(), kFolder), end; it != end; ++it) {
      std::istringstream neighbours((*it)[2].str());
      folders[module + "/" + (*it)[1].str()].insert(std::istream_iterator<std::string>(neighbours),
                                                    std::istream_iterator<std::string>());
    }
  }
  return folders;
}();

std::ptrdiff_t place(std::string_view module) {
  return std::find(kModules.begin(), kModules.end(), module) - kModules.begin();
}

bool is_module(std::string_view name) { return place(name) < std::ssize(kModules); }

/// `estimation` and `world` of `estimation/world/filter.hpp`; the second is empty without a folder.
std::pair<std::string, std::string> split(const fs::path& path) {
  const auto folder = std::next(path.begin());
  return {path.begin()->string(), std::next(folder) == path.end() ? "" : folder->string()};
}

/// Our headers that a file includes; a name without a slash is not of `server/`.
std::vector<fs::path> included_files(const SourceFile& file) {
  std::vector<fs::path> included;
  for (const std::string& line : file.lines) {
    const std::string path = included_by(line);
    if (path.find('/') != std::string::npos) included.emplace_back(path);
  }
  return included;
}

TEST(Modules, IncludeOnlyThemselvesAndEarlierOnes) {
  int includes = 0;
  for (const SourceFile& file : source_files({"server"})) {
    const auto module = split(file.path.lexically_relative("server")).first;
    EXPECT_TRUE(is_module(module)) << file.path << " is in no module of the order";
    for (const fs::path& included : included_files(file)) {
      const auto other = split(included).first;
      if (!is_module(other)) continue;
      ++includes;
      EXPECT_LE(place(other), place(module)) << file.path << ": " << included;
    }
  }
  EXPECT_GT(includes, 20) << "the test did not find the sources";
}

TEST(Modules, FoldersIncludeOnlyTheListedNeighbours) {
  std::set<std::string> seen;
  for (const SourceFile& file : source_files({"server"})) {
    const auto [module, folder] = split(file.path.lexically_relative("server"));
    if (folder.empty()) continue;
    const std::string name = module + "/" + folder;
    seen.insert(name);
    const auto listed = kFolders.find(name);
    ASSERT_NE(listed, kFolders.end()) << file.path << ": list what this folder may include";
    for (const fs::path& included : included_files(file)) {
      const auto [other_module, other] = split(included);
      if (other_module != module || other.empty() || other == folder) continue;
      EXPECT_TRUE(listed->second.contains(other)) << file.path << ": " << included;
    }
  }
  for (const auto& entry : kFolders)
    EXPECT_TRUE(seen.contains(entry.first)) << entry.first << " does not exist: remove it here";
}

TEST(Modules, FoldersIncludeEachOtherWithoutCycles) {
  for (const auto& [name, neighbours] : kFolders) {
    const std::string module = name.substr(0, name.find('/') + 1);
    std::set<std::string> reached;
    std::vector<std::string> to_visit(neighbours.begin(), neighbours.end());
    while (!to_visit.empty()) {
      const std::string next = to_visit.back();
      to_visit.pop_back();
      EXPECT_NE(module + next, name) << name << " includes itself through others";
      const auto found = kFolders.find(module + next);
      ASSERT_NE(found, kFolders.end()) << name << " includes " << next << ", which does not exist";
      if (reached.insert(next).second)
        to_visit.insert(to_visit.end(), found->second.begin(), found->second.end());
    }
  }
}

}  // namespace
}  // namespace fiducap::test
