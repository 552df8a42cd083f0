#include "streaming/natnet/natnet.hpp"

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/ip/udp.hpp>

#include "messages.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::natnet {
namespace {

namespace asio = boost::asio;
using asio::ip::udp;

constexpr auto kTimeout =
    std::chrono::seconds(2);  // for datagrams on loopback; reached only by a failure

/// A client's socket; what it gets, in order.
class Client {
 public:
  explicit Client(asio::io_context& io)
      : socket_(io, udp::endpoint(asio::ip::address_v4::loopback(), 0)) {
    socket_.non_blocking(true);
  }
  void send(const Bytes& datagram, std::uint16_t port, const char* address = "127.0.0.1") {
    socket_.send_to(asio::buffer(datagram), {asio::ip::make_address(address), port});
  }
  /// @return the next datagram; empty: none there
  Bytes take() {
    Bytes buffer(65536);
    boost::system::error_code error;
    const auto size = socket_.receive_from(asio::buffer(buffer), from_, 0, error);
    buffer.resize(error ? 0 : size);
    return buffer;
  }
  udp::socket& socket() { return socket_; }
  [[nodiscard]] std::uint16_t port() const { return socket_.local_endpoint().port(); }
  [[nodiscard]] const udp::endpoint& from() const { return from_; }

 private:
  udp::socket socket_;
  udp::endpoint from_;
};

class NatNetServerTest : public testing::Test {
 protected:
  NatNetServerTest() { config_.port = 0; }
  ~NatNetServerTest() override {
    server_.reset();
    io_.poll();
  }
  void start() {
    auto server = start_natnet_server(io_, config_, frame_->model, clock_, nullptr, 100);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
  }
  void publish() {
    frame_->number++;
    server_->publish(frame_);
  }
  /// Runs the server until this client got something.
  Bytes wait_for(Client& client) {
    const auto end = std::chrono::steady_clock::now() + kTimeout;
    while (std::chrono::steady_clock::now() < end) {
      io_.restart();
      io_.run_for(std::chrono::milliseconds(1));
      if (auto datagram = client.take(); !datagram.empty()) return datagram;
    }
    return {};
  }
  void join(Client& client) {
    client.send(ping(), server_->port());
    EXPECT_EQ(id_of(wait_for(client)), Message::kServerInfo);
    client.send(message(Message::kKeepAlive), server_->port());
    client.send(message(Message::kRequestModel), server_->port());
    EXPECT_EQ(id_of(wait_for(client)), Message::kModel);
  }
  std::vector<ClientStatus> clients() {
    std::vector<ClientStatus> all;
    server_->append_clients(all);
    return all;
  }

  asio::io_context io_;
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  NatNetConfig config_;
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame({"arm", "drone"});
  std::unique_ptr<NatNetStreamer> server_;
};

TEST_F(NatNetServerTest, FramesGoToTheSocketThatAskedFromAPortOfTheirOwn) {
  start();
  Client client(io_);
  join(client);
  publish();
  const Bytes frame = wait_for(client);
  EXPECT_EQ(id_of(frame), Message::kFrame);
  EXPECT_EQ(bodies_in(frame).size(), 2U);
  EXPECT_NE(client.from().port(), server_->port())
      << "the vendor's library ignores frames from the command port";
}

TEST_F(NatNetServerTest, ListsWhatItsClientsReceive) {
  start();
  Client client(io_);
  join(client);
  publish();
  const auto all = clients();
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].protocol, "natnet");
  EXPECT_EQ(all[0].peer, "127.0.0.1:" + std::to_string(client.port()) + " udp");
  EXPECT_EQ(all[0].detail, "bitstream 3.1, y-up m");
  EXPECT_EQ(all[0].frames_sent, 1U);
  EXPECT_EQ(all[0].frames_dropped, 0U);
  EXPECT_EQ(all[1].peer, "239.255.42.99:1511 multicast");
  EXPECT_EQ(all[1].detail, "by 127.0.0.1, bitstream 3.1, y-up m");
  EXPECT_EQ(all[1].frames_sent, 1U);
}

TEST_F(NatNetServerTest, HearsDiscoveryByBroadcastOnTheLoopback) {
  start();
  Client client(io_);
  client.socket().set_option(asio::socket_base::broadcast(true));
  client.send(message(Message::kDiscovery, sender_block({3, 1})), server_->port(),
              "127.255.255.255");
  EXPECT_EQ(id_of(wait_for(client)), Message::kServerInfo);
  EXPECT_EQ(client.from().port(), server_->port());
}

TEST_F(NatNetServerTest, AClientWhoseSocketIsClosedIsForgottenAndOthersLoseNothing) {
  start();
  Client stays(io_);
  {
    Client goes(io_);
    join(goes);
    join(stays);
  }
  constexpr int kFrames = 5;
  for (int i = 0; i < kFrames; ++i) {
    publish();
    EXPECT_EQ(id_of(wait_for(stays)), Message::kFrame) << i;
  }
  EXPECT_EQ(clients().size(), 2U) << "the one that stays, and the group";
}

TEST_F(NatNetServerTest, AThousandBodiesArriveInOneDatagram) {
  frame_ = make_scene_frame(std::vector<std::string>(1000, "x"));
  start();
  Client client(io_);
  client.socket().set_option(asio::socket_base::receive_buffer_size(1 << 20));
  client.send(connect({4, 1}, {4, 1}), server_->unicast_port());
  EXPECT_EQ(id_of(wait_for(client)), Message::kServerInfo);
  client.send(message(Message::kKeepAlive), server_->unicast_port());
  client.send(message(Message::kRequestModel), server_->unicast_port());
  EXPECT_EQ(id_of(wait_for(client)), Message::kModel);
  for (int i = 0; i < 20; ++i) {
    publish();
    EXPECT_EQ(wait_for(client).size(), 126 + 38 * 1000U);
  }
}

TEST_F(NatNetServerTest, SixtyFourClientsOfOneComputerAllGetEveryFrame) {
  start();
  std::vector<std::unique_ptr<Client>> all;
  for (int i = 0; i < 64; ++i) join(*all.emplace_back(std::make_unique<Client>(io_)));
  for (int i = 0; i < 3; ++i) {
    publish();
    for (auto& client : all) EXPECT_EQ(id_of(wait_for(*client)), Message::kFrame);
  }
}

TEST_F(NatNetServerTest, TwoPortsServeTwoKindsOfServer) {
  start();
  ASSERT_NE(server_->unicast_port(), 0);
  Client client(io_);
  client.send(ping(), server_->port());
  EXPECT_EQ(wait_for(client).at(kHeaderSize + 274), std::byte{1});
  client.send(ping(), server_->unicast_port());
  EXPECT_EQ(wait_for(client).at(kHeaderSize + 274), std::byte{0});
  server_.reset();
  config_.multicast = false;
  start();
  EXPECT_EQ(server_->unicast_port(), 0);
  client.send(ping(), server_->port());
  EXPECT_EQ(wait_for(client).at(kHeaderSize + 274), std::byte{0});
}

/// Bound to the port of the group as a client of another program would.
class Listener {
 public:
  explicit Listener(asio::io_context& io) : socket_(io) {
    socket_.open(udp::v4());
    socket_.set_option(udp::socket::reuse_address(true));
    socket_.bind({asio::ip::address_v4::any(), 0});
    socket_.non_blocking(true);
  }
  [[nodiscard]] bool join(const std::string& group, const char* card) {
    boost::system::error_code error;
    socket_.set_option(asio::ip::multicast::join_group(asio::ip::make_address_v4(group),
                                                       asio::ip::make_address_v4(card)),
                       error);
    return !error;
  }
  [[nodiscard]] std::uint16_t port() const { return socket_.local_endpoint().port(); }
  /// Datagrams that came, until none has come for a moment.
  std::size_t count(Bytes& last) {
    std::size_t n = 0;
    auto until = std::chrono::steady_clock::now() + kTimeout;
    while (std::chrono::steady_clock::now() < until) {
      Bytes buffer(65536);
      boost::system::error_code error;
      buffer.resize(socket_.receive(asio::buffer(buffer), 0, error));
      if (error) continue;
      ++n;
      last = buffer;
      until = std::chrono::steady_clock::now() + std::chrono::milliseconds(50);
    }
    return n;
  }

 private:
  udp::socket socket_;
};

TEST_F(NatNetServerTest, ALocalClientThatNeverAsksHearsTheGroupWhicheverCardItJoinedOn) {
  for (const char* card : {"127.0.0.1", "0.0.0.0", ""}) {
    Listener listener(io_);
    // On a machine without any network the system knows no card for a group.
    if (*card != '\0' && !listener.join(config_.multicast_group, card)) continue;
    config_.data_port = listener.port();
    server_.reset();
    start();
    publish();
    Bytes frame;
    EXPECT_EQ(listener.count(frame), 1U) << "joined on " << card;
    ASSERT_GE(frame.size(), kHeaderSize);
    EXPECT_EQ(bodies_in(frame).size(), 2U);
  }
}

TEST_F(NatNetServerTest, AGroupAmongTheTargetsGetsFramesToo) {
  Listener listener(io_);
  config_.multicast = false;
  config_.targets = {"224.0.0.1:" + std::to_string(listener.port())};
  start();
  publish();
  Bytes frame;
  EXPECT_EQ(listener.count(frame), 1U);
  EXPECT_EQ(clients().at(0).peer, config_.targets[0] + " multicast");
}

TEST_F(NatNetServerTest, SaysWhatToDoWhenAPortIsTaken) {
  start();
  config_.port = server_->port();
  const auto second = start_natnet_server(io_, config_, frame_->model, clock_, nullptr, 100);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().text().find("streaming.natnet.port"), std::string::npos)
      << second.error().text();
}

TEST_F(NatNetServerTest, GivesItsPortsBackWhenItStops) {
  const std::uint16_t any = config_.port;
  bool is_given_back = false;
  for (int attempt = 0; attempt < 5 && !is_given_back; ++attempt) {
    config_.port = any;
    start();
    config_.port = server_->port();
    server_->stop();
    // Another program of this machine may be quicker, but not five times.
    is_given_back =
        start_natnet_server(io_, config_, frame_->model, clock_, nullptr, 100).has_value();
  }
  EXPECT_TRUE(is_given_back);
}

TEST_F(NatNetServerTest, RefusesMoreBodiesThanClientsTake) {
  frame_ = make_scene_frame(std::vector<std::string>(1001, "x"));
  const auto server = start_natnet_server(io_, config_, frame_->model, clock_, nullptr, 100);
  ASSERT_FALSE(server);
  EXPECT_EQ(server.error().code, ErrorCode::kInvalid);
}

TEST_F(NatNetServerTest, SurvivesEverySortOfRubbish) {
  start();
  Client client(io_);
  client.send({}, server_->port());
  for (std::size_t size : {1U, 3U, 4U, 5U, 65507U})
    client.send(Bytes(size, std::byte{0xff}), server_->port());
  join(client);
}

TEST_F(NatNetServerTest, MayDieBeforeTheIoThreadIsDone) {
  start();
  server_.reset();
  EXPECT_NO_THROW(io_.poll());
}

}  // namespace
}  // namespace fiducap::natnet
