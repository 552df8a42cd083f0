// The real program from outside: exit codes, signals, what it prints.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "daemon/config/config_file.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

const std::string kDemo =
    (std::filesystem::path(FIDUCAP_SOURCE_DIR) / "config" / "demo.yaml").string();
const std::vector<std::string> kFreePorts{"--set", "streaming.vrpn.port=0",
                                          "--set", "streaming.native.port=0",
                                          "--set", "streaming.web.port=0",
                                          "--set", "bodies.0.source.camera.images=false",
                                          "--set", "bodies.1.source.camera.images=false",
                                          "--set", "bodies.2.source.camera.images=false"};

/// fiducapd with these arguments; its output goes to a file.
class Program final {
 public:
  explicit Program(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(),
                     (std::filesystem::path(FIDUCAP_BINARY_DIR) / "bin" / "fiducapd").string());
    std::vector<char*> argv;
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const std::string file = folder_.file("output");
    pid_ = ::fork();
    if (pid_ != 0) return;
    const int output = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ::dup2(output, STDOUT_FILENO);
    ::dup2(output, STDERR_FILENO);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  ~Program() {
    if (pid_ > 0) ::kill(pid_, SIGKILL), ::waitpid(pid_, nullptr, 0);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  int exit_code() {
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  void signal(int number) const { ::kill(pid_, number); }
  [[nodiscard]] std::string output() const {
    std::ostringstream text;
    text << std::ifstream(folder_.file("output")).rdbuf();
    return text.str();
  }
  [[nodiscard]] bool prints(const std::string& text) const {
    for (int i = 0; i < 300; ++i) {
      if (output().find(text) != std::string::npos) return true;
      std::this_thread::sleep_for(50ms);
    }
    return false;
  }

 private:
  TemporaryFolder folder_;
  pid_t pid_{-1};
};

std::vector<std::string> with_demo(std::vector<std::string> more) {
  more.insert(more.begin(), {"--config", kDemo});
  return more;
}

TEST(Fiducapd, FindsTheShippedDemoUsable) {
  Program program(with_demo({"--check-config"}));
  EXPECT_EQ(program.exit_code(), 0) << program.output();
}

TEST(Fiducapd, PrintsAConfigurationThatItTakesBack) {
  Program program(with_demo({"--print-config"}));
  ASSERT_EQ(program.exit_code(), 0);
  const auto again = parse_config(program.output(), "printed.yaml");
  ASSERT_TRUE(again) << again.error().front().text();
  EXPECT_EQ(print_config(*again), program.output());
}

TEST(Fiducapd, EndsWith2AndAllFaultsWhenTheConfigurationIsWrong) {
  Program program(with_demo({"--set", "tags.size_m=-1", "--set", "streaming.speed=3"}));
  EXPECT_EQ(program.exit_code(), 2);
  EXPECT_THAT(program.output(), HasSubstr("tags.size_m = -1: must be finite and > 0"));
  EXPECT_THAT(program.output(), HasSubstr("streaming.speed = 3: unknown key"));
}

TEST(Fiducapd, EndsWith2WhenTheCommandLineIsWrong) {
  EXPECT_EQ(Program({"--nonsense"}).exit_code(), 2);
  EXPECT_EQ(Program({}).exit_code(), 2);
  EXPECT_EQ(Program({"--config", "/no/such/file.yaml"}).exit_code(), 2);
}

TEST(Fiducapd, EndsWith1WhenSomethingItNeedsIsNotThere) {
  auto arguments = kFreePorts;
  arguments.insert(arguments.end(), {"--set", "map.file=/no/such/map.yaml"});
  Program program(with_demo(arguments));
  EXPECT_EQ(program.exit_code(), 1);
  EXPECT_THAT(program.output(), HasSubstr("/no/such/map.yaml"));
}

TEST(Fiducapd, EndsCleanlyOnSignalsWithinASecondAndSaysWhatItDid) {
  for (const int number : {SIGINT, SIGTERM}) {
    Program program(with_demo(kFreePorts));
    ASSERT_TRUE(program.prints("page on http://127.0.0.1:")) << program.output();
    const auto begin = std::chrono::steady_clock::now();
    program.signal(number);
    EXPECT_EQ(program.exit_code(), 0);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, 1s);
    EXPECT_THAT(program.output(), HasSubstr("drone: "));
    EXPECT_THAT(program.output(), HasSubstr("CPU per frame"));
  }
}

}  // namespace
}  // namespace fiducap
