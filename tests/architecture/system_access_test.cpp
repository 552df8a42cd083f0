// Where the time is read, UDP sockets are opened, threads started and the process ended
// (CONTRIBUTING.md).
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "architecture/source_files.hpp"

namespace fiducap::test {
namespace {

/// The machine's clocks. All other files get a `Clock` or the time.
const std::set<std::string> kReadMachineClocks{
    "server/daemon/system.cpp",            // the Clock
    "server/base/log.cpp",                 // when a line was written
    "server/base/process.cpp",             // what a thread costs
    "server/capture/ros/ros_source.cpp",   // ROS stamps are UTC
    "server/tools/terminal.cpp",           // how often a terminal is redrawn
    "server/tools/live/watch_verb.cpp",    // the same, and --duration
    "server/tools/live/events_verb.cpp",   // --duration
    "server/tools/live/control_verb.cpp",  // timeout of a recording's disk
};

/// Calls of `now()` of a Clock: in sources, which stamp and pace; in sockets, which pass the time
/// on to their sessions; in the daemon.
bool may_read_clock(const std::filesystem::path& path) {
  static const std::set<std::string> kSources{"byte_link",        "iio_source", "mode_choice",
                                              "recording_source", "ros_source", "v4l2_camera",
                                              "video_source"};
  static const std::vector<std::string> kSockets{"server", "session", "sockets"};
  const std::string stem = path.stem().string();
  const std::string text = path.string();
  if (text.starts_with("server/daemon/")) return true;
  if (text.starts_with("server/capture/")) return kSources.contains(stem);
  if (text == "server/simulation/simulated_source.cpp") return true;  // a live one is paced
  return text.starts_with("server/streaming/") &&
         std::any_of(kSockets.begin(), kSockets.end(),
                     [&](const std::string& socket) { return stem.ends_with(socket); });
}

/// A word is not in the middle of a longer name.
bool has_word(const std::string& code, const std::string& word) {
  for (auto at = code.find(word); at != std::string::npos; at = code.find(word, at + 1)) {
    if (at == 0) return true;
    const char before = code[at - 1];
    if (before != '_' && !std::isalnum(static_cast<unsigned char>(before))) return true;
  }
  return false;
}

using Words = std::vector<std::string>;

/// `file:line` of all code that has one of these words.
std::vector<std::string> places_of(const SourceFile& file, const Words& words) {
  std::vector<std::string> places;
  for (std::size_t i = 0; i < file.lines.size(); ++i) {
    if (std::any_of(words.begin(), words.end(), [&](const std::string& word) {
          return has_word(code_of(file.lines[i]), word);
        })) {
      places.push_back(file.place(i));
    }
  }
  return places;
}

/// Fails for each of these words outside of the daemon and of these files. Returns the places
/// within.
int expect_only_in(const std::set<std::string>& files, const Words& words, bool daemon = true) {
  int allowed = 0;
  for (const SourceFile& file : source_files({"server"})) {
    const auto places = places_of(file, words);
    const std::string path = file.path.string();
    if ((daemon && path.starts_with("server/daemon/")) || files.contains(path)) {
      allowed += static_cast<int>(places.size());
      continue;
    }
    for (const auto& place : places) ADD_FAILURE() << place;
  }
  return allowed;
}

TEST(Time, IsReadFromTheMachineInFewPlaces) {
  const Words machine_clock{"system_clock::now", "steady_clock::now", "high_resolution_clock::now",
                            "clock_gettime",     "gettimeofday",      "time(nullptr)"};
  std::set<std::string> found;
  for (const SourceFile& file : source_files({"server"})) {
    const auto places = places_of(file, machine_clock);
    if (places.empty()) continue;
    found.insert(file.path.string());
    EXPECT_TRUE(kReadMachineClocks.contains(file.path.string())) << places.front();
  }
  EXPECT_EQ(found, kReadMachineClocks) << "remove files that no longer do";
}

TEST(Time, IsReadFromTheClockInSourcesSocketsAndTheDaemon) {
  int reading = 0;
  for (const SourceFile& file : source_files({"server"})) {
    if (file.path == "server/base/time.hpp") continue;  // declares it
    if (kReadMachineClocks.contains(file.path.string())) continue;
    const auto places = places_of(file, {"now()"});
    reading += !places.empty();
    if (may_read_clock(file.path)) continue;
    for (const auto& place : places) ADD_FAILURE() << place;
  }
  EXPECT_GT(reading, 5) << "the test did not find the sources";
}

TEST(Time, IsNotWaitedForInUnitTests) {
  // Of programs with the label `loopback`.
  const std::set<std::string> real_time{
      "tests/unit/capture/imu/imu_source_test.cpp",
      "tests/unit/client/c_api_test.cpp",
      "tests/unit/client/client_reading_test.cpp",
      "tests/unit/client/client_server_test.cpp",
      "tests/unit/client/control_test.cpp",
      "tests/unit/client/profiles_test.cpp",
      "tests/unit/client/test_server.hpp",
      "tests/unit/daemon/session_recorder_test.cpp",    // the recorder's thread
      "tests/unit/daemon/camera_preview_test.cpp",      // the thread of the pictures
      "tests/unit/mapping/store/map_store_writer.cpp",  // of a simulation: it is killed in real
                                                        // time
      "tests/unit/streaming/dds/flood_test.cpp",        // the middleware's threads
      "tests/unit/streaming/mavlink/mavlink_server_test.cpp",
      "tests/unit/streaming/natnet/natnet_server_test.cpp",
      "tests/unit/streaming/server_fixture.hpp",
      "tests/unit/streaming/web/loopback_client.hpp",
      "tests/unit/streaming/web/web_server_test.cpp",
  };
  const Words waits{"sleep_for",         "sleep_until",   "usleep",
                    "steady_clock::now", "run_for",       "run_one_for",
                    "system_clock::now", "clock_gettime", "SystemClock"};
  for (const SourceFile& file : source_files({"tests/unit"})) {
    if (real_time.contains(file.path.string())) continue;
    for (const auto& place : places_of(file, waits)) ADD_FAILURE() << place;
  }
}

TEST(Sockets, UdpIsOpenedOnlyWhereTheRuleOfSendersIsKept) {
  const int found = expect_only_in(
      {
          "server/capture/imu/byte_link.cpp",      // the UDP socket of IMUs, under the rule
          "server/streaming/net/bind.cpp",         // the UDP socket of protocols, for udp_server
          "server/streaming/net/bind.hpp",         //
          "server/streaming/net/udp_server.cpp",   //
          "server/middleware/network.cpp",         // looks at those of Cyclone DDS, opens none
          "server/daemon/watch/health_watch.cpp",  // AF_UNIX, to systemd
          "server/tools/doctor/network_check.cpp"  // tests multicast of a card, in another process
      },
      {"SOCK_DGRAM", "SOCK_RAW", "udp::socket"}, false);
  EXPECT_GE(found, 6) << "the test did not find the sources";
}

TEST(Threads, AreStartedInTheDaemonAndTheLog) {
  expect_only_in(
      {"server/base/log.cpp",                   // a terminal may block for ever
       "server/streaming/dds/dds_server.cpp"},  // leaving a flooded domain takes a second
      {"std::thread ", "std::thread(", "std::thread{", "std::jthread", "std::async",
       "pthread_create", "fork()"});
}

// A tool with a changed priority would wait minutes for an idle machine.
TEST(Threads, KeepThePriorityOfTheCallerOutsideOfTheDaemon) {
  const int found = expect_only_in(
      {"server/base/log.cpp"},  // its thread does not inherit real time
      {"sched_setscheduler", "sched_setattr", "setpriority", "pthread_setschedparam", "nice(",
       "set_realtime_priority", "set_background", "set_reversible", "restore_normal_priority"});
  EXPECT_GT(found, 0) << "the test did not find the sources";
}

TEST(TheProcess, IsEndedOnlyByABrokenContract) {
  expect_only_in({"server/base/expected.hpp"},
                 {"std::exit", "::_exit", "std::quick_exit", "std::abort", "std::terminate"},
                 false);
}

}  // namespace
}  // namespace fiducap::test
