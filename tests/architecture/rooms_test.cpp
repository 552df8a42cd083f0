// The order of the rooms is a test, not a hope: an earlier room must not include a later one.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace {

namespace fs = std::filesystem;
constexpr std::array<std::string_view, 13> kRooms{
    "base",  "middleware", "capture",     "detection", "estimation", "mapping", "pipeline",
    "scene", "simulation", "calibration", "streaming", "daemon",     "tools"};

std::ptrdiff_t place(std::string_view room) {
  return std::find(kRooms.begin(), kRooms.end(), room) - kRooms.begin();
}

TEST(Rooms, IncludeOnlyThemselvesAndRoomsBeforeThem) {
  const fs::path server = fs::path(FIDUCAP_SOURCE_DIR) / "server";
  int includes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(server)) {
    const auto extension = entry.path().extension();
    if (extension != ".hpp" && extension != ".cpp") continue;
    const std::string room = entry.path().lexically_relative(server).begin()->string();
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);) {
      if (line.rfind("#include \"", 0) != 0) continue;
      const auto from = line.find('"') + 1;
      const auto slash = line.find('/', from);
      if (slash == std::string::npos) continue;
      const std::string included = line.substr(from, slash - from);
      if (place(included) == static_cast<std::ptrdiff_t>(kRooms.size())) continue;
      ++includes;
      EXPECT_LE(place(included), place(room)) << entry.path() << ": " << line;
    }
  }
  EXPECT_GT(includes, 20) << "the test did not find the sources";
}

}  // namespace
