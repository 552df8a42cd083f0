// The program fiducapd: exit codes, signals, output.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include "daemon/config/config_file.hpp"
#include "support/fiducapd_process.hpp"
#include "support/running_server.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// A pipe that is full, as of `| less`.
class FullPipe final {
 public:
  FullPipe() {
    EXPECT_EQ(::pipe2(ends_.data(), O_CLOEXEC | O_NONBLOCK), 0);
    while (::write(ends_[1], "x", 1) == 1) {
    }
    ::fcntl(ends_[1], F_SETFL, 0);  // now a writer blocks
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

/// The answer to one request; empty: none.
std::string ask(std::uint16_t port, const std::string& request, const std::string& secret = {}) {
  boost::asio::ip::tcp::iostream web(boost::asio::ip::address_v4::loopback().to_string(),
                                     std::to_string(port));
  if (!web) return {};
  web.expires_after(5s);
  web << request << " HTTP/1.0\r\nHost: localhost\r\nX-Fiducap-Setup: " << secret << "\r\n\r\n"
      << std::flush;
  std::ostringstream answer;
  answer << web.rdbuf();
  return answer.str();
}

/// @return whether the answer has that text within a minute
bool answers(std::uint16_t port, const std::string& request, const std::string& secret,
             const std::string& what) {
  return wait_until([&] { return ask(port, request, secret).find(what) != std::string::npos; });
}

/// @return whether frames flow within a minute
bool is_healthy(std::uint16_t port) {
  return wait_until([&] {
    const std::string answer = ask(port, "GET /healthz");
    return answer.substr(0, answer.find('\n')).find(" 200 ") != std::string::npos;
  });
}

/// The secret in the printed address; empty: none is printed.
std::string printed_secret(const FiducapdProcess& program, std::uint16_t port) {
  const std::string address = "http://127.0.0.1:" + std::to_string(port) + "/#";
  if (!program.prints(address)) return {};
  const std::string output = program.output();
  const auto from = output.find(address) + address.size();
  return output.substr(from, output.find('\n', from) - from);
}

std::vector<std::string> with_demo(std::vector<std::string> more) {
  more.insert(more.begin(), {"--config", demo_file()});
  return more;
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

TEST(Fiducapd, PrintsAConfigurationThatItReads) {
  FiducapdProcess program(with_demo({"--print-config"}));
  ASSERT_EQ(program.exit_code(), 0);
  const auto again = value_of(parse_config(program.output(), "printed.yaml"));
  EXPECT_EQ(print_config(again), program.output());
}

TEST(Fiducapd, EndsWith2AndAllFaultsOfTheConfiguration) {
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

TEST(Fiducapd, EndsWith1WhenAFileIsMissing) {
  auto arguments = corners_on_free_ports();
  arguments.insert(arguments.end(), {"--set", "map.file=/no/such/map.yaml"});
  FiducapdProcess program(with_demo(arguments));
  EXPECT_EQ(program.exit_code(), 1);
  EXPECT_THAT(program.output(), HasSubstr("/no/such/map.yaml"));
}

TEST(Fiducapd, EndsWithStatisticsWithinASecondOfASignal) {
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

/// The demo with its output into that file serves and ends.
void expect_serves(
    int output, const std::function<void()>& started = [] {}) {
  const std::uint16_t port = free_port();
  auto arguments = corners_on_free_ports();
  arguments.insert(arguments.end(), {"--set", "streaming.web.port=" + std::to_string(port)});
  FiducapdProcess program(with_demo(arguments), output);
  started();
  EXPECT_TRUE(is_healthy(port));
  program.signal(SIGTERM);
  EXPECT_EQ(program.exit_code(), 0);
}

TEST(Fiducapd, ServesAndEndsWhenItsOutputIsNotRead) { expect_serves(FullPipe().in()); }

TEST(Fiducapd, ServesAndEndsWhenItsTerminalIsGone) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe2(ends.data(), O_CLOEXEC), 0);
  ::close(ends[0]);
  expect_serves(ends[1], [&] { ::close(ends[1]); });
}

TEST(Fiducapd, SetsUpOnThePageAndServes) {
  const TemporaryFolder folder;
  const std::string file = folder.file("robot.yaml");
  const std::uint16_t port = free_port();
  std::vector<std::string> arguments{"--setup", file, "--simulated"};
  for (const char* protocol : {"vrpn", "native", "natnet"})
    arguments.insert(arguments.end(),
                     {"--set", "streaming." + std::string(protocol) + ".enabled=false"});
  arguments.insert(arguments.end(), {"--set", "streaming.web.port=" + std::to_string(port)});
  FiducapdProcess program(arguments);
  const std::string secret = printed_secret(program, port);
  ASSERT_EQ(secret.size(), 32u) << program.output();
  const auto say = [&](const std::string& command) {
    EXPECT_THAT(ask(port, "POST /api/v1/setup/" + command, secret), HasSubstr(" 202 ")) << command;
  };
  const auto setup_shows = [&](const std::string& what) {
    return answers(port, "GET /api/v1/setup", secret, what);
  };
  ASSERT_TRUE(setup_shows("\"step\":\"camera\"")) << program.output();
  EXPECT_THAT(ask(port, "GET /api/v1/setup", "1"), HasSubstr(" 403 "));
  say("camera?open=/dev/video63");
  EXPECT_TRUE(setup_shows("/dev/video63"));
  say("camera?open=simulated");
  ASSERT_TRUE(setup_shows("\"corners\":[["));
  EXPECT_TRUE(answers(port, "GET /api/v1/setup/picture", secret, "image/jpeg"))
      << "made on request";
  for (const char* command : {"next", "next", "sheet?size_mm=400", "next", "guess",
                              "imu?source=", "next", "next", "write"})
    say(command);
  // The same process continues with a robot instead of the set-up.
  EXPECT_TRUE(is_healthy(port)) << program.output();
  ASSERT_TRUE(program.prints("serving 1 bodies")) << program.output();
  EXPECT_TRUE(std::filesystem::exists(file));
  EXPECT_THAT(ask(port, "GET /api/v1/setup", secret),
              testing::AllOf(HasSubstr(" 200 "), testing::EndsWith("null")));
  EXPECT_THAT(ask(port, "GET /api/v1/state"), testing::Not(HasSubstr(secret))) << "in its log";
  program.signal(SIGTERM);
  EXPECT_EQ(program.exit_code(), 0) << program.output();
}

TEST(Fiducapd, EndsWith2WhenASetupHasAWrongSetting) {
  const TemporaryFolder folder;
  FiducapdProcess program({"--setup", folder.file("robot.yaml"), "--set", "streaming.web.prot=1"});
  EXPECT_EQ(program.exit_code(), 2);
  EXPECT_THAT(program.output(), HasSubstr("did you mean port?"));
}

}  // namespace
}  // namespace fiducap
