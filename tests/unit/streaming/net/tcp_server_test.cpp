#include <gtest/gtest.h>

#include <boost/asio/write.hpp>
#include <stdexcept>
#include <string>

#include "streaming/net/bind.hpp"
#include "streaming/net/tcp_server.hpp"
#include "streaming/net/tcp_session.hpp"
#include "support/fake_clock.hpp"

namespace fiducap::net {
namespace {

constexpr Instant kStart = instant_from_ns(1'000'000'000);

std::vector<std::byte> bytes(std::string_view text) {
  const auto view = std::as_bytes(std::span(text.data(), text.size()));
  return {view.begin(), view.end()};
}
SharedBytes frame(std::string_view text) {
  return std::make_shared<const std::vector<std::byte>>(bytes(text));
}

class TcpOutboxTest : public testing::Test {
 protected:
  std::string take(Instant now = kStart) {
    const auto pieces = outbox_.take(now);
    std::string text = pieces ? "" : "nothing";
    if (pieces) {
      for (const auto& piece : *pieces)
        text.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    }
    return text;
  }
  TcpOutbox outbox_;
};

TEST_F(TcpOutboxTest, RepliesGoBeforeTheFrame) {
  outbox_.offer(frame("frame"));
  outbox_.reply(bytes("reply,"));
  EXPECT_EQ(take(), "reply,frame");
}

TEST_F(TcpOutboxTest, OfFramesOnlyTheNewestWaits) {
  EXPECT_TRUE(outbox_.offer(frame("old")));
  EXPECT_FALSE(outbox_.offer(frame("new")));
  EXPECT_EQ(take(), "new");
}

TEST_F(TcpOutboxTest, WhatIsUnderWayStaysWholeWhileMoreArrives) {
  outbox_.reply(bytes("one"));
  outbox_.offer(frame("1"));
  const auto pieces = outbox_.take(kStart);
  outbox_.reply(bytes("two"));
  EXPECT_TRUE(outbox_.offer(frame("2"))) << "the frame under way is not lost";
  EXPECT_EQ(take(), "nothing") << "one write at a time";
  EXPECT_EQ(std::string(reinterpret_cast<const char*>((*pieces)[0].data()), 3), "one");
  outbox_.written(kStart);
  EXPECT_EQ(take(), "two2");
}

TEST_F(TcpOutboxTest, AClientThatDoesNotReadMustGo) {
  outbox_.offer(frame("1"));
  take();
  EXPECT_FALSE(outbox_.overdue(kStart + TcpOutbox::kMaxWait));
  EXPECT_TRUE(outbox_.overdue(kStart + TcpOutbox::kMaxWait + Duration(1)));
}

TEST_F(TcpOutboxTest, RepliesThatPileUpEndItToo) {
  outbox_.reply(std::vector<std::byte>(TcpOutbox::kMaxReplyBytes));
  EXPECT_FALSE(outbox_.overdue(kStart));
  outbox_.reply(bytes("x"));
  EXPECT_TRUE(outbox_.overdue(kStart));
}

TEST_F(TcpOutboxTest, AReaderThatKeepsUpIsNeverOverdue) {
  for (int second = 0; second < 20; ++second) {
    const Instant now = kStart + std::chrono::seconds(second);
    outbox_.offer(frame("f"));
    outbox_.reply(bytes("r"));
    EXPECT_EQ(take(now), "rf");
    EXPECT_FALSE(outbox_.overdue(now));
    outbox_.written(now);
  }
}

using boost::asio::ip::tcp;

/// Echoes every byte; `!` ends it, `#` makes it throw.
class Echo final : public TcpSession {
 public:
  Echo(Socket socket, const Clock& clock) : TcpSession(std::move(socket), "test", clock) {}
  void publish() {
    if (throws_later) throw std::runtime_error("cannot be encoded");
    offer(std::make_shared<const std::vector<std::byte>>(1, std::byte{'f'}));
  }
  [[nodiscard]] bool may_be_replaced(Instant) const override { return is_replaceable; }
  bool throws_later{false};
  bool is_replaceable{false};

 protected:
  void received(std::span<const std::byte> got) override {
    if (got.empty()) return;
    if (got.front() == std::byte{'!'}) return close("as requested");
    if (got.front() == std::byte{'#'}) throw std::runtime_error("a handler's defect");
    send(got);
  }
  void ticked(Instant) override {
    if (throws_later) throw std::runtime_error("cannot tick");
  }
};

class TcpServerTest : public testing::Test {
 protected:
  TcpServerTest() {
    port_ = server_
                .listen({"127.0.0.1", 0, "streaming.test"},
                        [this](Socket socket, const Peer&) {
                          sessions_.push_back(std::make_shared<Echo>(std::move(socket), clock_));
                          return sessions_.back();
                        })
                .value();
  }

  /// @param host  of 127.0.0.0/8: each is an address of its own
  tcp::socket dial(std::uint32_t host = 0x7f000001) {
    tcp::socket client(io_, tcp::endpoint(boost::asio::ip::address_v4(host), 0));
    client.connect({boost::asio::ip::address_v4::loopback(), port_});
    client.non_blocking(true);
    return client;
  }
  tcp::socket connect(std::uint32_t host = 0x7f000001) {
    const auto before = sessions_.size();
    auto client = dial(host);
    while (sessions_.size() == before) io_.run_one();
    return client;
  }
  void say(tcp::socket& client, char letter) {
    boost::asio::write(client, boost::asio::buffer(&letter, 1));
  }
  std::string read(tcp::socket& client, std::size_t size) {
    std::string text(size, '\0');
    std::size_t have = 0;
    while (have < size) {
      io_.poll();
      boost::system::error_code error;
      have += client.read_some(boost::asio::buffer(text.data() + have, size - have), error);
      if (error && error != boost::asio::error::would_block) return "end";
    }
    return text;
  }
  std::string echo(tcp::socket& client, char letter) {
    say(client, letter);
    return read(client, 1);
  }
  /// Until the server's own timer has gone off.
  void tick() {
    const int before = ticks_;
    while (ticks_ == before) io_.run_one();
  }
  void start() {
    server_.start([this](Instant) {
      ++ticks_;
      if (tick_throws_) throw std::runtime_error("a tick's defect");
    });
  }

  static constexpr int kMost = 3;
  boost::asio::io_context io_;
  FakeClock clock_;
  std::vector<std::shared_ptr<Echo>> sessions_;
  TcpServer server_{io_, {"test", kMost, 2, "streaming.test"}, clock_};
  std::uint16_t port_{0};
  int ticks_{0};
  bool tick_throws_{false};
};

TEST_F(TcpServerTest, AnswersWhatItReceives) {
  auto client = connect();
  EXPECT_EQ(echo(client, 'h'), "h");
}

TEST_F(TcpServerTest, AClientThatNeverReadsLosesFramesAndThenItsPlace) {
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

TEST_F(TcpServerTest, ASessionMayCloseItselfWhileReceiving) {
  auto client = connect();
  EXPECT_EQ(echo(client, '!'), "end");
  EXPECT_TRUE(sessions_[0]->closed());
}

TEST_F(TcpServerTest, WhatASessionThrowsWhileReceivingEndsThatSessionOnly) {
  auto broken = connect();
  auto other = connect();
  EXPECT_EQ(echo(broken, '#'), "end");
  EXPECT_TRUE(sessions_[0]->closed());
  EXPECT_EQ(echo(other, 'a'), "a");
  start();
  tick();
  auto next = connect();
  EXPECT_EQ(echo(next, 'b'), "b") << "it goes on accepting";
}

TEST_F(TcpServerTest, WhatASessionThrowsForAFrameEndsThatSessionOnly) {
  auto broken = connect();
  auto other = connect();
  sessions_[0]->throws_later = true;
  server_.each<Echo>([](Echo& session) { session.publish(); });
  EXPECT_TRUE(sessions_[0]->closed());
  EXPECT_EQ(read(other, 1), "f");
}

TEST_F(TcpServerTest, WhatIsThrownInATickStopsNoTicks) {
  auto broken = connect();
  auto other = connect();
  sessions_[0]->throws_later = true;
  tick_throws_ = true;
  start();
  tick();
  tick();
  EXPECT_TRUE(sessions_[0]->closed());
  EXPECT_EQ(echo(other, 'a'), "a");
}

TEST_F(TcpServerTest, AMakerThatThrowsCostsThatConnectionOnly) {
  bool throws = true;
  const auto port =
      server_.listen({"127.0.0.1", 0, "streaming.test"}, [&](Socket socket, const Peer&) {
        if (std::exchange(throws, false)) throw std::runtime_error("no memory");
        sessions_.push_back(std::make_shared<Echo>(std::move(socket), clock_));
        return sessions_.back();
      });
  port_ = port.value();
  auto first = dial();
  EXPECT_EQ(read(first, 1), "end");
  auto second = connect();
  EXPECT_EQ(echo(second, 'a'), "a");
}

TEST_F(TcpServerTest, OneAddressGetsNoMoreThanItsPlaces) {
  auto one = connect();
  auto two = connect();
  auto three = dial();
  EXPECT_EQ(read(three, 1), "end");
  EXPECT_EQ(echo(one, '!'), "end");
  auto four = connect();
  EXPECT_EQ(echo(four, 'a'), "a") << "a place is free again";
}

TEST_F(TcpServerTest, WhoHoldsTheMostPlacesGivesOneToWhoHasNone) {
  constexpr std::uint32_t kGreedy = 0x7f000002, kOther = 0x7f000003, kThird = 0x7f000004;
  auto first = connect(kGreedy);
  auto second = connect(kGreedy);
  auto other = connect(kOther);
  auto third = connect(kThird);
  EXPECT_FALSE(sessions_[0]->closed());
  EXPECT_TRUE(sessions_[1]->closed()) << "the newest of the two";
  EXPECT_EQ(echo(first, 'a'), "a");
  EXPECT_EQ(echo(third, 'b'), "b");
  auto back = dial(kGreedy);
  EXPECT_EQ(read(back, 1), "end") << "everybody has one now";
  EXPECT_EQ(echo(other, 'c'), "c");
}

TEST_F(TcpServerTest, ManyAddressesBlockNoClientWhileOneMayBeReplaced) {
  auto first = connect(0x7f000002);
  auto second = connect(0x7f000003);
  auto third = connect(0x7f000004);
  auto refused = dial(0x7f000005);
  EXPECT_EQ(read(refused, 1), "end") << "none of them";
  sessions_[1]->is_replaceable = true;
  sessions_[2]->is_replaceable = true;
  auto newcomer = connect(0x7f000005);
  EXPECT_EQ(echo(newcomer, 'a'), "a");
  EXPECT_TRUE(sessions_[1]->closed()) << "the oldest of the two";
  EXPECT_FALSE(sessions_[2]->closed());
  EXPECT_EQ(echo(first, 'b'), "b");
}

TEST_F(TcpServerTest, ConnectsToAPeerWithinTheSameLimits) {
  tcp::acceptor listening(io_, {boost::asio::ip::address_v4::loopback(), 0});
  const Peer peer = peer_of(listening.local_endpoint());
  int made = 0;
  const auto make = [&](Socket socket, const Peer&) {
    ++made;
    return std::make_shared<Echo>(std::move(socket), clock_);
  };
  server_.connect(peer, std::chrono::seconds(3), make);
  server_.connect(peer, std::chrono::seconds(3), make);
  tcp::socket client = listening.accept();
  client.non_blocking(true);
  EXPECT_EQ(echo(client, 'a'), "a");
  EXPECT_EQ(made, 1) << "one connection to one peer at a time";
}

/// Takes connections until its queue is full, and answers none after that.
class FullListener final {
 public:
  explicit FullListener(boost::asio::io_context& io) : acceptor_(io), first_(io) {
    acceptor_.open(tcp::v4());
    acceptor_.bind({boost::asio::ip::address_v4::any(), 0});
    acceptor_.listen(0);
    first_.connect({boost::asio::ip::address_v4::loopback(), port()});
  }
  [[nodiscard]] std::uint16_t port() const { return acceptor_.local_endpoint().port(); }

 private:
  tcp::acceptor acceptor_;
  tcp::socket first_;
};

TEST_F(TcpServerTest, SilentAddressesDoNotBlockOtherConnections) {
  FullListener silent(io_);
  tcp::acceptor real(io_, {boost::asio::ip::address_v4::loopback(), 0});
  const auto make = [this](Socket socket, const Peer&) {
    sessions_.push_back(std::make_shared<Echo>(std::move(socket), clock_));
    return sessions_.back();
  };
  for (std::uint32_t i = 0; i < 2 * TcpServer::kMaxConnecting; ++i)
    server_.connect({0x7f000101 + i, silent.port()}, std::chrono::seconds(3), make);
  server_.connect({0x7f000001, real.local_endpoint().port()}, std::chrono::seconds(3), make);
  io_.poll();
  ASSERT_FALSE(sessions_.empty());
  EXPECT_EQ(sessions_.back()->peer().port, real.local_endpoint().port());
}

TEST_F(TcpServerTest, NothingIsCalledAfterItHasStopped) {
  auto client = connect();
  start();
  server_.stop();
  EXPECT_EQ(read(client, 1), "end");
  io_.restart();
  io_.run();
  EXPECT_EQ(ticks_, 0);
  tcp::socket late(io_);
  boost::system::error_code error;
  late.connect({boost::asio::ip::address_v4::loopback(), port_}, error);
  EXPECT_TRUE(error);
}

TEST_F(TcpServerTest, SessionsMaySendALastMessage) {
  auto client = connect();
  server_.stop(std::chrono::milliseconds(1));
  EXPECT_FALSE(sessions_[0]->closed());
  io_.restart();
  io_.run();
  EXPECT_TRUE(sessions_[0]->closed());
}

}  // namespace
}  // namespace fiducap::net
