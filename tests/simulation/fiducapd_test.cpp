// The real program from outside: exit codes, signals, what it prints.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
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
#include "support/fiducapd_process.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

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

/// What the server answers to `GET /healthz` once frames flow, or last within a minute.
std::string health(std::uint16_t port) {
  std::string line;
  for (int i = 0; i < 1200; ++i, std::this_thread::sleep_for(50ms)) {
    boost::asio::ip::tcp::iostream web(boost::asio::ip::address_v4::loopback().to_string(),
                                       std::to_string(port));
    if (!web) continue;
    web.expires_after(5s);
    web << "GET /healthz HTTP/1.0\r\nHost: localhost\r\n\r\n" << std::flush;
    if (std::getline(web, line) && line.find(" 200 ") != std::string::npos) break;
  }
  return line;
}

std::vector<std::string> with_demo(std::vector<std::string> more) {
  more.insert(more.begin(), {"--config", demo_file()});
  return more;
}

TEST(Fiducapd, FindsTheShippedDemoUsable) {
  FiducapdProcess program(with_demo({"--check-config"}));
  EXPECT_EQ(program.exit_code(), 0) << program.output();
}

TEST(Fiducapd, RefusesATokenThatOthersCanRead) {
  const TemporaryFolder folder;
  const std::string token = folder.file("token");
  std::ofstream(token) << "correct horse\n";
  std::filesystem::permissions(token, std::filesystem::perms(0644));
  for (const char* how : {"--check-config", "--exit-at-end"}) {
    FiducapdProcess program(with_demo({how, "--set", "operator.token_file=" + token}));
    EXPECT_EQ(program.exit_code(), 2) << how;
    EXPECT_THAT(program.output(), HasSubstr("chmod 600"));
    EXPECT_THAT(program.output(), testing::Not(HasSubstr("correct horse")));
  }
}

TEST(Fiducapd, PrintsAConfigurationThatItTakesBack) {
  FiducapdProcess program(with_demo({"--print-config"}));
  ASSERT_EQ(program.exit_code(), 0);
  const auto again = parse_config(program.output(), "printed.yaml");
  ASSERT_TRUE(again) << again.error().front().text();
  EXPECT_EQ(print_config(*again), program.output());
}

TEST(Fiducapd, EndsWith2AndAllFaultsWhenTheConfigurationIsWrong) {
  FiducapdProcess program(with_demo({"--set", "tags.size_m=-1", "--set", "streaming.speed=3"}));
  EXPECT_EQ(program.exit_code(), 2);
  EXPECT_THAT(program.output(), HasSubstr("tags.size_m = -1: must be finite and > 0"));
  EXPECT_THAT(program.output(), HasSubstr("streaming.speed = 3: unknown key"));
}

TEST(Fiducapd, EndsWith2WhenTheCommandLineIsWrong) {
  EXPECT_EQ(FiducapdProcess({"--nonsense"}).exit_code(), 2);
  EXPECT_EQ(FiducapdProcess({}).exit_code(), 2);
  EXPECT_EQ(FiducapdProcess({"--config", "/no/such/file.yaml"}).exit_code(), 2);
}

TEST(Fiducapd, EndsWith1WhenSomethingItNeedsIsNotThere) {
  auto arguments = corners_on_free_ports();
  arguments.insert(arguments.end(), {"--set", "map.file=/no/such/map.yaml"});
  FiducapdProcess program(with_demo(arguments));
  EXPECT_EQ(program.exit_code(), 1);
  EXPECT_THAT(program.output(), HasSubstr("/no/such/map.yaml"));
}

TEST(Fiducapd, EndsCleanlyOnSignalsWithinASecondAndSaysWhatItDid) {
  for (const int number : {SIGINT, SIGTERM}) {
    FiducapdProcess program(with_demo(corners_on_free_ports()));
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
  auto arguments = corners_on_free_ports();
  arguments.insert(arguments.end(), {"--set", "streaming.web.port=" + std::to_string(port)});
  FiducapdProcess program(with_demo(arguments), terminal.in());
  EXPECT_THAT(health(port), HasSubstr(" 200 "));
  program.signal(SIGTERM);
  EXPECT_EQ(program.exit_code(), 0);
}

TEST(Fiducapd, ServesAndEndsWhenItsTerminalIsGone) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe2(ends.data(), O_CLOEXEC), 0);
  ::close(ends[0]);
  const std::uint16_t port = free_port();
  auto arguments = corners_on_free_ports();
  arguments.insert(arguments.end(), {"--set", "streaming.web.port=" + std::to_string(port)});
  FiducapdProcess program(with_demo(arguments), ends[1]);
  ::close(ends[1]);
  EXPECT_THAT(health(port), HasSubstr(" 200 "));
  program.signal(SIGTERM);
  EXPECT_EQ(program.exit_code(), 0);
}

}  // namespace
}  // namespace fiducap
