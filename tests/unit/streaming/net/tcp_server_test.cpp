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

using boost::asio::ip::tcp;

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
    if (!pieces) return "nothing";
    std::string all;
    for (const auto& piece : *pieces)
      all.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    return all;
  }
  TcpOutbox outbox_;
};

TEST_F(TcpOutboxTest, SendsRepliesThenTheNewestFrame) {
  EXPECT_TRUE(outbox_.offer(frame("old")));
  EXPECT_FALSE(outbox_.offer(frame("new")));
  outbox_.reply(bytes("reply,"));
  EXPECT_EQ(take(), "reply,new");
}

TEST_F(TcpOutboxTest, WriteUnderWayStaysWholeWhileMoreArrives) {
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

TEST_F(TcpOutboxTest, IsOverdueAfterASlowWriteOrTooManyReplies) {
  outbox_.offer(frame("1"));
  take();
  EXPECT_FALSE(outbox_.overdue(kStart + TcpOutbox::kMaxWait));
  EXPECT_TRUE(outbox_.overdue(kStart + TcpOutbox::kMaxWait + Duration(1)));
  TcpOutbox full;
  full.reply(std::vector<std::byte>(TcpOutbox::kMaxReplyBytes));
  EXPECT_FALSE(full.overdue(kStart));
  full.reply(bytes("x"));
  EXPECT_TRUE(full.overdue(kStart));
}

TEST_F(TcpOutboxTest, TimelyWritesAreNeverOverdue) {
  for (int second = 0; second < 20; ++second) {
    const Instant now = kStart + std::chrono::seconds(second);
    outbox_.offer(frame("f"));
    outbox_.reply(bytes("r"));
    EXPECT_EQ(take(now), "rf");
    EXPECT_FALSE(outbox_.overdue(now));
    outbox_.written(now);
  }
}

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
  TcpServerTest() : port_(listen([this](Socket socket, const Peer&) { return make(socket); })) {}

  std::uint16_t listen(TcpServer::MakeSession make) {
    return server_.listen({"127.0.0.1", 0, "streaming.test"}, std::move(make)).value();
  }
  std::shared_ptr<Echo> make(Socket& socket) {
    sessions_.push_back(std::make_shared<Echo>(std::move(socket), clock_));
    return sessions_.back();
  }
  void connect_to(const Peer& peer) {
    server_.connect(peer, std::chrono::seconds(3),
                    [this](Socket socket, const Peer&) { return make(socket); });
  }
  tcp::acceptor listener() { return {io_, {boost::asio::ip::address_v4::loopback(), 0}}; }

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
  /// The next byte, or "end" when the connection is closed.
  std::string read(tcp::socket& client) {
    for (char letter = 0;;) {
      io_.poll();
      boost::system::error_code error;
      if (client.read_some(boost::asio::buffer(&letter, 1), error) == 1) return {letter};
      if (error != boost::asio::error::would_block) return "end";
    }
  }
  std::string echo(tcp::socket& client, char letter) {
    boost::asio::write(client, boost::asio::buffer(&letter, 1));
    return read(client);
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

TEST_F(TcpServerTest, ClientThatNeverReadsLosesFramesThenItsConnection) {
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

TEST_F(TcpServerTest, EndsSessionsOnRequestOrExceptionOnly) {
  auto first = connect();
  auto other = connect();
  EXPECT_EQ(echo(first, 'h'), "h");
  EXPECT_EQ(echo(first, '!'), "end");
  EXPECT_TRUE(sessions_[0]->closed());
  auto broken = connect();
  EXPECT_EQ(echo(broken, '#'), "end");
  EXPECT_TRUE(sessions_[2]->closed());
  EXPECT_EQ(echo(other, 'a'), "a");
  start();
  tick();
  auto next = connect();
  EXPECT_EQ(echo(next, 'b'), "b") << "the server still accepts";
}

TEST_F(TcpServerTest, ExceptionForAFrameOrInATickEndsItsSessionOnly) {
  auto first = connect();
  auto other = connect();
  sessions_[0]->throws_later = true;
  server_.each<Echo>([](Echo& session) { session.publish(); });
  EXPECT_TRUE(sessions_[0]->closed());
  EXPECT_EQ(read(other), "f");
  auto broken = connect();
  sessions_[2]->throws_later = true;
  tick_throws_ = true;
  start();
  tick();
  tick();
  EXPECT_TRUE(sessions_[2]->closed());
  EXPECT_EQ(echo(other, 'a'), "a");
}

TEST_F(TcpServerTest, ExceptionWhileAcceptingEndsItsConnectionOnly) {
  bool throws = true;
  port_ = listen([&](Socket socket, const Peer&) {
    if (std::exchange(throws, false)) throw std::runtime_error("no memory");
    return make(socket);
  });
  auto first = dial();
  EXPECT_EQ(read(first), "end");
  auto second = connect();
  EXPECT_EQ(echo(second, 'a'), "a");
}

TEST_F(TcpServerTest, AddressHasALimitedNumberOfConnections) {
  auto one = connect();
  auto two = connect();
  auto three = dial();
  EXPECT_EQ(read(three), "end");
  EXPECT_EQ(echo(one, '!'), "end");
  auto four = connect();
  EXPECT_EQ(echo(four, 'a'), "a") << "a place is free again";
}

TEST_F(TcpServerTest, AddressWithMostConnectionsYieldsToOneWithNone) {
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
  EXPECT_EQ(read(back), "end") << "each address has one now";
  EXPECT_EQ(echo(other, 'c'), "c");
}

TEST_F(TcpServerTest, NewAddressReplacesTheOldestReplaceableSession) {
  auto first = connect(0x7f000002);
  auto second = connect(0x7f000003);
  auto third = connect(0x7f000004);
  auto refused = dial(0x7f000005);
  EXPECT_EQ(read(refused), "end") << "none is replaceable";
  sessions_[1]->is_replaceable = true;
  sessions_[2]->is_replaceable = true;
  auto fourth = connect(0x7f000005);
  EXPECT_EQ(echo(fourth, 'a'), "a");
  EXPECT_TRUE(sessions_[1]->closed());
  EXPECT_FALSE(sessions_[2]->closed());
  EXPECT_EQ(echo(first, 'b'), "b");
}

TEST_F(TcpServerTest, MakesOneOutgoingConnectionToAPeer) {
  tcp::acceptor peer = listener();
  connect_to(peer_of(peer.local_endpoint()));
  connect_to(peer_of(peer.local_endpoint()));
  tcp::socket client = peer.accept();
  client.non_blocking(true);
  EXPECT_EQ(echo(client, 'a'), "a");
  EXPECT_EQ(sessions_.size(), 1u);
}

/// Accepts connections until its queue is full, then none.
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

TEST_F(TcpServerTest, PeersThatDoNotAcceptBlockNoOtherConnection) {
  FullListener silent(io_);
  tcp::acceptor real = listener();
  const std::uint16_t port = real.local_endpoint().port();
  for (std::uint32_t i = 0; i < 2 * TcpServer::kMaxConnecting; ++i)
    connect_to({0x7f000101 + i, silent.port()});
  connect_to({0x7f000001, port});
  io_.poll();
  ASSERT_FALSE(sessions_.empty());
  EXPECT_EQ(sessions_.back()->peer().port, port);
}

TEST_F(TcpServerTest, CallsNothingAfterStop) {
  auto client = connect();
  start();
  server_.stop();
  EXPECT_EQ(read(client), "end");
  io_.restart();
  io_.run();
  EXPECT_EQ(ticks_, 0);
  tcp::socket late(io_);
  boost::system::error_code error;
  late.connect({boost::asio::ip::address_v4::loopback(), port_}, error);
  EXPECT_TRUE(error);
}

TEST_F(TcpServerTest, StopLeavesTimeForALastMessage) {
  auto client = connect();
  server_.stop(std::chrono::milliseconds(1));
  EXPECT_FALSE(sessions_[0]->closed());
  io_.restart();
  io_.run();
  EXPECT_TRUE(sessions_[0]->closed());
}

}  // namespace
}  // namespace fiducap::net
