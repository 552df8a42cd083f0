// Who may ask what time it is, start threads and end the process (CONTRIBUTING.md).
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <string>
#include <vector>

#include "architecture/source_files.hpp"

namespace fiducap::test {
namespace {

/// The clocks of the machine itself. Everybody else has a `Clock` handed in, or the time.
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

/// `now()` of the handed-in Clock: sources, which stamp and pace; sockets, which pass the time on
/// to the conversations they carry; the daemon.
bool may_ask(const std::filesystem::path& path) {
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

bool is_letter(char c) { return c == '_' || std::isalnum(static_cast<unsigned char>(c)) != 0; }

/// Not in the middle of a longer name.
bool has_word(const std::string& code, const std::string& word) {
  for (auto at = code.find(word); at != std::string::npos; at = code.find(word, at + 1)) {
    if (at == 0 || !is_letter(code[at - 1])) return true;
  }
  return false;
}

/// `file:line` of all code that has one of these words.
std::vector<std::string> places_of(const SourceFile& file, const std::vector<std::string>& words) {
  std::vector<std::string> places;
  for (std::size_t i = 0; i < file.lines.size(); ++i) {
    const std::string code = code_of(file.lines[i]);
    if (std::any_of(words.begin(), words.end(),
                    [&](const std::string& word) { return has_word(code, word); })) {
      places.push_back(file.path.string() + ":" + std::to_string(i + 1));
    }
  }
  return places;
}

TEST(Time, IsReadFromTheMachineInFewPlaces) {
  const std::vector<std::string> machine_clock{
      "system_clock::now", "steady_clock::now", "high_resolution_clock::now",
      "clock_gettime",     "gettimeofday",      "time(nullptr)"};
  std::set<std::string> found;
  for (const SourceFile& file : source_files({"server"})) {
    const auto places = places_of(file, machine_clock);
    if (places.empty()) continue;
    found.insert(file.path.string());
    EXPECT_TRUE(kReadMachineClocks.contains(file.path.string())) << places.front();
  }
  EXPECT_EQ(found, kReadMachineClocks) << "strike out who no longer does";
}

TEST(Time, IsAskedForBySourcesSocketsAndTheDaemonAlone) {
  int asking = 0;
  for (const SourceFile& file : source_files({"server"})) {
    if (file.path == "server/base/time.hpp") continue;  // declares it
    if (kReadMachineClocks.contains(file.path.string())) continue;
    const auto places = places_of(file, {"now()"});
    asking += !places.empty();
    if (may_ask(file.path)) continue;
    for (const auto& place : places) ADD_FAILURE() << place;
  }
  EXPECT_GT(asking, 5) << "the test did not find the sources";
}

TEST(Time, IsNotWaitedForByUnitTests) {
  // Of programs with the label `loopback`.
  const std::set<std::string> real_time{
      "tests/unit/capture/imu/imu_source_test.cpp",
      "tests/unit/capture/imu/px4_source_test.cpp",
      "tests/unit/client/c_api_test.cpp",
      "tests/unit/client/client_reading_test.cpp",
      "tests/unit/client/client_server_test.cpp",
      "tests/unit/client/clock_test.cpp",
      "tests/unit/client/control_test.cpp",
      "tests/unit/client/profiles_test.cpp",
      "tests/unit/client/test_server.hpp",
      "tests/unit/daemon/session_recorder_test.cpp",    // the recorder's thread
      "tests/unit/daemon/camera_preview_test.cpp",      // the thread of the pictures
      "tests/unit/mapping/store/map_store_writer.cpp",  // of a simulation: it is killed in real
                                                        // time
      "tests/unit/streaming/dds/crowd_test.cpp",        // the middleware's threads
      "tests/unit/streaming/mavlink/mavlink_server_test.cpp",
      "tests/unit/streaming/natnet/natnet_server_test.cpp",
      "tests/unit/streaming/web/loopback_client.hpp",
      "tests/unit/streaming/web/web_server_test.cpp",
  };
  const std::vector<std::string> waits{"sleep_for",         "sleep_until",   "usleep",
                                       "steady_clock::now", "run_for",       "run_one_for",
                                       "system_clock::now", "clock_gettime", "SystemClock"};
  for (const SourceFile& file : source_files({"tests/unit"})) {
    if (real_time.contains(file.path.string())) continue;
    for (const auto& place : places_of(file, waits)) ADD_FAILURE() << place;
  }
}

TEST(Threads, AreStartedByTheDaemonAndTheLogAlone) {
  const std::vector<std::string> starts{"std::thread ", "std::thread(", "std::thread{",
                                        "std::jthread", "std::async",   "pthread_create",
                                        "fork()"};
  for (const SourceFile& file : source_files({"server"})) {
    if (file.path.string().starts_with("server/daemon/")) continue;
    if (file.path == "server/base/log.cpp") continue;  // a terminal may block for ever
    // The middleware may take a second to leave a flooded domain.
    if (file.path == "server/streaming/dds/dds_server.cpp") continue;
    for (const auto& place : places_of(file, starts)) ADD_FAILURE() << place;
  }
}

// A tool that runs where nothing else wants to waits minutes for an idle machine.
TEST(Threads, KeepThePriorityOfTheCallerOutsideOfTheDaemon) {
  const std::vector<std::string> changes{
      "sched_setscheduler",    "sched_setattr",  "setpriority",
      "pthread_setschedparam", "nice(",          "set_realtime_priority",
      "set_background",        "set_reversible", "restore_normal_priority"};
  int places_in_the_daemon = 0;
  for (const SourceFile& file : source_files({"server"})) {
    const auto places = places_of(file, changes);
    if (file.path.string().starts_with("server/daemon/")) {
      places_in_the_daemon += static_cast<int>(places.size());
      continue;
    }
    if (file.path == "server/base/log.cpp") continue;  // its thread does not inherit real time
    for (const auto& place : places) ADD_FAILURE() << place;
  }
  EXPECT_GT(places_in_the_daemon, 0) << "the test did not find the sources";
}

TEST(TheProcess, IsEndedByNobodyButABrokenContract) {
  const std::vector<std::string> ends{"std::exit", "::_exit", "std::quick_exit", "std::abort",
                                      "std::terminate"};
  for (const SourceFile& file : source_files({"server"})) {
    if (file.path == "server/base/expected.hpp") continue;
    for (const auto& place : places_of(file, ends)) ADD_FAILURE() << place;
  }
}

}  // namespace
}  // namespace fiducap::test
