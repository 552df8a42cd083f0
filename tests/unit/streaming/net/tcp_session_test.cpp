#include "streaming/net/tcp_session.hpp"

#include <gtest/gtest.h>

#include <boost/asio/write.hpp>
#include <string>

#include "streaming/net/tcp_listener.hpp"
#include "support/fake_clock.hpp"

namespace fiducap::net {
namespace {

using boost::asio::ip::tcp;

/// Says every received byte back.
class Echo final : public TcpSession {
 public:
  Echo(tcp::socket socket, const Clock& clock) : TcpSession(std::move(socket), "test", clock) {}

 protected:
  void received(std::span<const std::byte> got) override {
    if (!got.empty() && got.front() == std::byte{'!'}) return close("was told to");
    send(got);
  }
};

class TcpSessionTest : public testing::Test {
 protected:
  TcpSessionTest()
      : listener_(std::move(
            TcpListener::open(io_, {"127.0.0.1", 0, "streaming.test"}, [this](tcp::socket socket) {
              sessions_.push_back(std::make_shared<Echo>(std::move(socket), clock_));
              sessions_.back()->start();
            }).value())) {}

  tcp::socket connect() {
    tcp::socket client(io_);
    client.connect({boost::asio::ip::address_v4::loopback(), listener_.port()});
    const auto before = sessions_.size();
    while (sessions_.size() == before) io_.run_one();
    return client;
  }

  std::string read(tcp::socket& client, std::size_t size) {
    std::string text(size, '\0');
    std::size_t have = 0;
    client.non_blocking(true);
    while (have < size) {
      io_.poll();
      boost::system::error_code error;
      have += client.read_some(boost::asio::buffer(text.data() + have, size - have), error);
      if (error && error != boost::asio::error::would_block) return "end: " + error.message();
    }
    return text;
  }

  boost::asio::io_context io_;
  FakeClock clock_;
  std::vector<std::shared_ptr<Echo>> sessions_;
  TcpListener listener_;
};

TEST_F(TcpSessionTest, AnswersWhatItReceives) {
  auto client = connect();
  boost::asio::write(client, boost::asio::buffer("hello", 5));
  EXPECT_EQ(read(client, 5), "hello");
}

TEST_F(TcpSessionTest, AClientThatNeverReadsLosesFramesAndThenItsPlace) {
  auto client = connect();
  const auto big = std::make_shared<const std::vector<std::byte>>(1 << 20);
  for (int i = 0; i < 50; ++i) {
    sessions_[0]->offer(big);
    io_.poll();
  }
  EXPECT_GE(sessions_[0]->frames_dropped(), 40u);
  EXPECT_FALSE(sessions_[0]->closed());
  clock_.advance(TcpOutbox::kMaxWait + std::chrono::milliseconds(1));
  sessions_[0]->tick(clock_.now());
  EXPECT_TRUE(sessions_[0]->closed());
}

TEST_F(TcpSessionTest, MayCloseItselfWhileReceiving) {
  auto client = connect();
  boost::asio::write(client, boost::asio::buffer("!", 1));
  EXPECT_TRUE(read(client, 1).starts_with("end"));
  EXPECT_TRUE(sessions_[0]->closed());
}

TEST_F(TcpSessionTest, TheListenerStopsWithItsOwner) {
  listener_.stop();
  tcp::socket client(io_);
  boost::system::error_code error;
  client.connect({boost::asio::ip::address_v4::loopback(), listener_.port()}, error);
  EXPECT_TRUE(error);
}

}  // namespace
}  // namespace fiducap::net
