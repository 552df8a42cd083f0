#include "tools/doctor/doctor.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <thread>

#include "mapping/store/map_store.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;

/// Listens on a free port of this machine.
class Listener final {
 public:
  Listener() : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in place{};
    place.sin_family = AF_INET;
    place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof place;
    EXPECT_EQ(::bind(fd_, reinterpret_cast<sockaddr*>(&place), size), 0);
    EXPECT_EQ(::listen(fd_, 4), 0);
    EXPECT_EQ(::getsockname(fd_, reinterpret_cast<sockaddr*>(&place), &size), 0);
    port_ = ntohs(place.sin_port);
  }
  ~Listener() { ::close(fd_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// Takes one connection, reads a part of the question, answers, ends it.
  void answer_once(const std::string& answer) const {
    const int peer = ::accept(fd_, nullptr, nullptr);
    std::array<char, 4096> question{};
    EXPECT_GT(::recv(peer, question.data(), question.size(), 0), 0);
    EXPECT_EQ(::send(peer, answer.data(), answer.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(answer.size()));
    ::close(peer);
  }

 private:
  int fd_;
  std::uint16_t port_{};
};

Expected<std::string> answered(const std::string& answer) {
  const Listener listener;
  std::jthread server([&] { listener.answer_once(answer); });
  return http_get("127.0.0.1", listener.port(), "/api/v1/state", 5s);
}

TEST(HttpGet, GivesTheBodyOfAGoodAnswer) {
  const auto body = answered("HTTP/1.1 200 OK\r\nA: b\r\n\r\n{\"x\":1}");
  ASSERT_TRUE(body) << body.error().text();
  EXPECT_EQ(*body, "{\"x\":1}");
}

TEST(HttpGet, NamesWhatElseCame) {
  EXPECT_NE(answered("HTTP/1.1 421 Misdirected\r\n\r\n").error().text().find("421"),
            std::string::npos);
  EXPECT_NE(answered("SSH-2.0-x\r\n").error().text().find("does not speak HTTP"),
            std::string::npos);
  const Listener nobody_accepts;
  EXPECT_FALSE(http_get("127.0.0.1", nobody_accepts.port(), "/", 50ms)) << "ends by itself";
  EXPECT_FALSE(http_get("no such host.invalid", 1, "/", 50ms));
}

TEST(ServerFacts, AlarmsOfAServerThatHasNone) {
  for (const char* text : {"", "{}", "[]", "not json", "{\"events\":3}", "{\"events\":[1,null]}",
                           "{\"events\":{\"standing\":{}}}"})
    EXPECT_TRUE(alarms_in(text).empty()) << text;
}

TEST(ServerFacts, AlarmsAreReadWithTheirRemedies) {
  const std::string list =
      R"([{"subject":"map","severity":"error","text":"not stored","remedy":"make room"}])";
  for (const std::string& json :
       {R"({"events":)" + list + "}", R"({"events":{"standing":)" + list + "}}"}) {
    const auto alarms = alarms_in(json);
    ASSERT_EQ(alarms.size(), 1u) << json;
    EXPECT_EQ(alarms.front().subject, "map");
    EXPECT_EQ(alarms.front().remedy, "make room");
  }
}

TEST(ServerFacts, ThisMachineIsLookedAt) {
  const TemporaryFolder folder;
  ServerConfig config;
  config.streaming.web.enabled = false;
  config.map.store = folder.file("hall.map");
  config.recorder.folder = folder.file("not/yet/there");
  config.operators.token = "four and twenty";
  const Listener listener;
  auto facts = gather_facts(config, "127.0.0.1");
  EXPECT_GT(facts.machine.cores, 0);
  EXPECT_EQ(facts.token.length, 15u);
  ASSERT_TRUE(facts.store);
  EXPECT_FALSE(facts.store->exists);
  EXPECT_TRUE(facts.store->writable);
  EXPECT_TRUE(facts.recordings.writable);
  EXPECT_TRUE(facts.recordings.free_bytes);
  const auto own = std::find_if(facts.listening.begin(), facts.listening.end(),
                                [&](const auto& one) { return one.port == listener.port(); });
  ASSERT_NE(own, facts.listening.end());
  EXPECT_NE(own->owner.find("(process " + std::to_string(::getpid()) + ")"), std::string::npos);

  auto store = MapStore::open(config.map.store);
  ASSERT_TRUE(store && store->claim());
  facts = gather_facts(config, "127.0.0.1");
  EXPECT_TRUE(facts.store->exists);
  EXPECT_EQ(facts.store->holder, "process " + std::to_string(::getpid()));
  EXPECT_TRUE(facts.store->damage.empty());
  EXPECT_EQ(facts.store->unreadable, "");

  config.map.store = folder.write("garbage", std::string(5000, 'x'));
  EXPECT_NE(gather_facts(config, "127.0.0.1").store->unreadable, "");
}

}  // namespace
}  // namespace fiducap
