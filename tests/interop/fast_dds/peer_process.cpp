#include "peer_process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <sstream>
#include <thread>

#include "support/scene_builder.hpp"

namespace fiducap::dds {

namespace {

int number_after(const std::string& line, const std::string& key) {
  const auto at = line.find(key + "=");
  return at == std::string::npos ? 0 : std::atoi(line.c_str() + at + key.size() + 1);
}

}  // namespace

PeerProcess::PeerProcess(const std::vector<std::string>& arguments,
                         const std::function<void()>& before_exec) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return;
  std::string program = FAST_DDS_PEER;
  std::vector<char*> argv{program.data()};
  for (const auto& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_ = ::fork();
  if (pid_ == 0) {
    ::dup2(ends[1], STDOUT_FILENO);
    if (before_exec) before_exec();
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  ::close(ends[1]);
  output_ = ends[0];
}

PeerProcess::~PeerProcess() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  if (output_ >= 0) ::close(output_);
}

bool PeerProcess::is_running() {
  siginfo_t info{};
  return pid_ > 0 &&
         ::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
         info.si_pid == 0;
}

std::map<std::string, Heard> PeerProcess::heard() {
  std::string text;
  char buffer[4096];
  for (ssize_t n = 0; (n = ::read(output_, buffer, sizeof(buffer))) > 0;)
    text.append(buffer, static_cast<std::size_t>(n));
  std::map<std::string, Heard> all;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const auto last = line.find("last: ");
    if (last == std::string::npos) continue;
    all[line.substr(0, line.find(' '))] = {number_after(line, "count"), number_after(line, "ids"),
                                           number_after(line, "incompatible"),
                                           line.substr(last + 6)};
  }
  return all;
}

void publish_frames(Streamer& server, const std::vector<std::string>& bodies,
                    const std::function<bool()>& go_on) {
  auto due = std::chrono::steady_clock::now();
  for (std::uint64_t number = 1; go_on(); ++number) {
    auto frame = make_scene_frame(bodies, number);
    auto map = std::make_shared<TagMap>();
    MapTag tag;
    tag.tag.tag_id = 7;
    tag.tag.edge_m = 0.2;
    tag.tag.X_WT = {Eigen::Quaterniond::Identity(), {3.0, 2.0, 1.0}};
    tag.state = TagState::kSurveyed;
    map->tags.push_back(tag);
    static const std::shared_ptr<const TagMap> kMap = map;
    frame->map = kMap;
    server.publish(frame);
    due += std::chrono::milliseconds(10);
    std::this_thread::sleep_until(due);
  }
}

}  // namespace fiducap::dds
