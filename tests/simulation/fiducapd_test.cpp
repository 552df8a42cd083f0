// The real program from outside: exit codes, signals, what it prints.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
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

/// fiducapd with these arguments; its output goes to a file, or to `output` where one is given.
class Program final {
 public:
  explicit Program(std::vector<std::string> arguments, int output_to = -1) {
    arguments.insert(arguments.begin(),
                     (std::filesystem::path(FIDUCAP_BINARY_DIR) / "bin" / "fiducapd").string());
    std::vector<char*> argv;
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const std::string file = folder_.file("output");
    pid_ = ::fork();
    if (pid_ != 0) return;
    const int output =
        output_to >= 0 ? output_to : ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
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

/// A pipe that takes not one byte more, like `| less` that nobody scrolls.
class FullPipe final {
 public:
  FullPipe() {
    EXPECT_EQ(::pipe2(ends_.data(), O_CLOEXEC | O_NONBLOCK), 0);
    while (::write(ends_[1], "x", 1) == 1) {
    }
    ::fcntl(ends_[1], F_SETFL, 0);  // from here on a writer waits
  }
  ~FullPipe() {
    ::close(ends_[0]);
    ::close(ends_[1]);
  }
  FullPipe(const FullPipe&) = delete;
  FullPipe& operator=(const FullPipe&) = delete;
  [[nodiscard]] int in() const { return ends_[1]; }

 private:
  std::array<int, 2> ends_{};
};

std::uint16_t free_port() {
  boost::asio::io_context io;
  const boost::asio::ip::tcp::acceptor any(io, {boost::asio::ip::address_v4::loopback(), 0});
  return any.local_endpoint().port();
}

/// What the server answers to `GET /healthz`; empty: nothing within a minute.
std::string health(std::uint16_t port) {
  for (int i = 0; i < 1200; ++i, std::this_thread::sleep_for(50ms)) {
    boost::asio::ip::tcp::iostream web(boost::asio::ip::address_v4::loopback().to_string(),
                                       std::to_string(port));
    if (!web) continue;
    web.expires_after(5s);
    web << "GET /healthz HTTP/1.0\r\nHost: localhost\r\n\r\n" << std::flush;
    std::string line;
    if (std::getline(web, line)) return line;
  }
  return {};
}

std::vector<std::string> with_demo(std::vector<std::string> more) {
  more.insert(more.begin(), {"--config", kDemo});
  return more;
}

TEST(Fiducapd, FindsTheShippedDemoUsable) {
  Program program(with_demo({"--check-config"}));
  EXPECT_EQ(program.exit_code(), 0) << program.output();
}

TEST(Fiducapd, RefusesATokenThatOthersCanRead) {
  const TemporaryFolder folder;
  const std::string token = folder.file("token");
  std::ofstream(token) << "correct horse\n";
  std::filesystem::permissions(token, std::filesystem::perms(0644));
  for (const char* how : {"--check-config", "--exit-at-end"}) {
    Program program(with_demo({how, "--set", "operator.token_file=" + token}));
    EXPECT_EQ(program.exit_code(), 2) << how;
    EXPECT_THAT(program.output(), HasSubstr("chmod 600"));
    EXPECT_THAT(program.output(), testing::Not(HasSubstr("correct horse")));
  }
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

TEST(Fiducapd, ServesAndEndsWhileNobodyReadsWhatItSays) {
  const FullPipe terminal;
  const std::uint16_t port = free_port();
  auto arguments = kFreePorts;
  arguments.insert(arguments.end(), {"--set", "streaming.web.port=" + std::to_string(port)});
  Program program(with_demo(arguments), terminal.in());
  EXPECT_THAT(health(port), HasSubstr(" 200 "));
  program.signal(SIGTERM);
  EXPECT_EQ(program.exit_code(), 0);
}

TEST(Fiducapd, ServesAndEndsWhenItsTerminalIsGone) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe2(ends.data(), O_CLOEXEC), 0);
  ::close(ends[0]);
  const std::uint16_t port = free_port();
  auto arguments = kFreePorts;
  arguments.insert(arguments.end(), {"--set", "streaming.web.port=" + std::to_string(port)});
  Program program(with_demo(arguments), ends[1]);
  ::close(ends[1]);
  EXPECT_THAT(health(port), HasSubstr(" 200 "));
  program.signal(SIGTERM);
  EXPECT_EQ(program.exit_code(), 0);
}

}  // namespace
}  // namespace fiducap
