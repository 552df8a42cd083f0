#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <thread>

#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "daemon/operator_token.hpp"
#include "daemon/watch/health_watch.hpp"
#include "mapping/store/file_claim.hpp"
#include "mapping/store/map_repair.hpp"
#include "middleware/participant.hpp"
#include "tools/doctor/doctor.hpp"

namespace fiducap {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kPageTimeout{1500};
// The server announces itself every dds.announce_s, 2 s by default.
constexpr std::chrono::milliseconds kDdsTimeout{4000};
constexpr const char* kServerProcess = "fiducapd";

std::string first_word_of(const fs::path& path) {
  std::ifstream file(path);
  std::string word;
  file >> word;
  return word;
}

std::optional<long long> number_in(const fs::path& path) {
  std::ifstream file(path);
  long long number = 0;
  return file >> number ? std::optional(number) : std::nullopt;
}

std::optional<long> realtime_most() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_RTPRIO, &limit) != 0) return std::nullopt;
  const long most = ::sched_get_priority_max(SCHED_RR);
  if (::geteuid() == 0 || limit.rlim_cur == RLIM_INFINITY) return most;
  return std::min(most, static_cast<long>(limit.rlim_cur));
}

/// Empty without systemd, and without such a unit.
std::string unit_state() {
  if (!fs::exists("/run/systemd/system")) return {};
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> answer(
      ::popen("systemctl show -P ActiveState -P LoadState fiducapd.service 2>/dev/null", "r"),
      &::pclose);
  if (!answer) return {};
  std::array<char, 64> state{};
  std::array<char, 64> loaded{};
  if (std::fscanf(answer.get(), "%63s %63s", state.data(), loaded.data()) != 2) return {};
  return std::string_view(loaded.data()) == "loaded" ? state.data() : std::string{};
}

bool has_realtime_thread(const fs::path& process) {
  std::error_code gone;
  for (const auto& task : fs::directory_iterator(process / "task", gone)) {
    const int policy = ::sched_getscheduler(std::atoi(task.path().filename().c_str()));
    if (policy >= 0 && (policy & ~SCHED_RESET_ON_FORK) != SCHED_OTHER) return true;
  }
  return false;
}

std::vector<RunningServer> running_servers() {
  std::vector<RunningServer> all;
  std::error_code gone;
  for (const auto& process : fs::directory_iterator("/proc", gone)) {
    const int pid = std::atoi(process.path().filename().c_str());
    if (pid > 0 && first_word_of(process.path() / "comm") == kServerProcess)
      all.push_back({pid, has_realtime_thread(process.path())});
  }
  return all;
}

StoreFacts store_facts(const std::string& path) {
  std::error_code unknown;
  StoreFacts facts;
  facts.path = path;
  facts.folder = folder_facts(fs::absolute(path, unknown).parent_path());
  facts.exists = fs::exists(path, unknown);
  facts.writable = facts.exists ? ::access(path.c_str(), W_OK) == 0 : facts.folder.writable;
  if (!facts.exists) return facts;
  facts.holder = FileClaim::holder(path);
  if (const auto health = check_map_store(path))
    facts.damage = health->sentences();
  else
    facts.unreadable = health.error().what;
  return facts;
}

std::string text_in(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string{};
}

}  // namespace

Findings alarms_in(std::string_view state_json) {
  const auto state = nlohmann::json::parse(state_json, nullptr, false);
  if (!state.is_object()) return {};
  const auto events = state.value("events", nlohmann::json{});
  const auto standing = events.is_object() ? events.value("standing", nlohmann::json{}) : events;
  if (!standing.is_array()) return {};
  Findings alarms;
  for (const auto& one : standing) {
    if (!one.is_object()) continue;
    const std::string severity = text_in(one, "severity");
    const std::string text = text_in(one, "subject") + ": " + text_in(one, "text");
    if (severity == "info")
      alarms.push_back({Grade::kOk, text});
    else
      alarms.push_back(
          {severity == "error" ? Grade::kFault : Grade::kWarning, text, text_in(one, "remedy")});
  }
  return alarms;
}

ServerFacts gather_facts(const ServerConfig& config, const std::string& host) {
  ServerFacts facts;
  facts.machine.cores = static_cast<int>(std::thread::hardware_concurrency());
  facts.machine.governor = first_word_of("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
  facts.machine.realtime_most = realtime_most();
  facts.machine.receive_buffer_most = number_in("/proc/sys/net/core/rmem_max");
  facts.machine.send_buffer_most = number_in("/proc/sys/net/core/wmem_max");
  facts.machine.clock_synchronised = read_machine_state().clock_synchronised;
  facts.machine.unit = unit_state();
  const auto tokens = with_tokens(config.operators, std::getenv("CREDENTIALS_DIRECTORY"));
  if (tokens)
    facts.token.length = tokens->token.size();
  else
    facts.token.unreadable = tokens.error().text();
  facts.servers = running_servers();
  facts.listening = listening_ports();
  if (config.streaming.dds.enabled && config.dds.is_loopback() && !facts.servers.empty()) {
    const auto found = dds::is_found_by_default(config.dds.domain, kServerProcess, kDdsTimeout);
    if (found) facts.dds_found = *found;
  }
  if (!config.map.store.empty()) facts.store = store_facts(config.map.store);
  facts.recordings = recordings_of(config);
  if (config.streaming.web.enabled) {
    if (const auto state = http_get(host, config.streaming.web.port, "/api/v1/state", kPageTimeout,
                                    tokens ? tokens->read_token : ""))
      facts.alarms = alarms_in(*state);
  }
  return facts;
}

}  // namespace fiducap
