#include "streaming/natnet/natnet.hpp"

#include <gmock/gmock.h>

#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/ip/udp.hpp>

#include "messages.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::natnet {
namespace {

namespace asio = boost::asio;
using asio::ip::udp;

/// For datagrams on loopback; reached only by a failure.
constexpr auto kTimeout = std::chrono::seconds(2);

/// A client's socket; what it receives, in order.
class Client {
 public:
  explicit Client(asio::io_context& io,
                  const asio::ip::address& address = asio::ip::address_v4::loopback(),
                  bool shared = false)
      : socket_(io, udp::v4()) {
    socket_.set_option(udp::socket::reuse_address(shared));
    socket_.bind({address, 0});
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
    server_.reset();
    auto server =
        serve({.io = io_, .model = frame_->model, .clock = clock_, .rate_hz = 100}, config_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
  }
  void publish() {
    frame_->number++;
    server_->publish(frame_);
  }
  /// Runs the server until this client receives a datagram.
  Bytes wait_for(Client& client) {
    const auto end = std::chrono::steady_clock::now() + kTimeout;
    while (std::chrono::steady_clock::now() < end) {
      io_.restart();
      io_.run_for(std::chrono::milliseconds(1));
      if (auto datagram = client.take(); !datagram.empty()) return datagram;
    }
    return {};
  }
  Bytes ask(Client& client, const Bytes& request, std::uint16_t port) {
    client.send(request, port);
    return wait_for(client);
  }
  void join(Client& client, std::uint16_t port = 0, const Bytes& hello = ping()) {
    if (port == 0) port = server_->port();
    EXPECT_EQ(id_of(ask(client, hello, port)), Message::kServerInfo);
    client.send(message(Message::kKeepAlive), port);
    EXPECT_EQ(id_of(ask(client, message(Message::kRequestModel), port)), Message::kModel);
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
  std::unique_ptr<Streamer> server_;
  Client client_{io_};
};

TEST_F(NatNetServerTest, SendsFramesFromADataPortAndReportsItsClients) {
  start();
  join(client_);
  publish();
  const Bytes frame = wait_for(client_);
  EXPECT_EQ(id_of(frame), Message::kFrame);
  EXPECT_EQ(bodies_in(frame).size(), 2U);
  EXPECT_NE(client_.from().port(), server_->port())
      << "the vendor's library ignores frames from the command port";
  const auto all = clients();
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].protocol, "natnet");
  EXPECT_EQ(all[0].peer, "127.0.0.1:" + std::to_string(client_.port()) + " udp");
  EXPECT_EQ(all[0].detail, "bitstream 3.1, y-up m");
  EXPECT_EQ(all[0].frames_sent, 1U);
  EXPECT_EQ(all[0].frames_dropped, 0U);
  EXPECT_EQ(all[1].peer, "239.255.42.99:1511 multicast");
  EXPECT_EQ(all[1].detail, "by 127.0.0.1, bitstream 3.1, y-up m");
  EXPECT_EQ(all[1].frames_sent, 1U);
}

/// A port that was free a moment ago.
std::uint16_t free_port(asio::io_context& io) { return Client(io).port(); }

bool can_bind(asio::io_context& io, std::uint16_t port) {
  udp::socket socket(io, udp::v4());
  boost::system::error_code error;
  socket.bind({asio::ip::address_v4::any(), port}, error);
  return !error;
}

TEST_F(NatNetServerTest, FramesLeaveFromTheDataPortForLibrariesThatTakeNoOthers) {
  config_.multicast = false;
  config_.data_port = free_port(io_);
  start();
  join(client_);
  publish();
  EXPECT_EQ(id_of(wait_for(client_)), Message::kFrame);
  EXPECT_NE(client_.from().port(), config_.data_port) << "a local client may need it for itself";
  EXPECT_TRUE(can_bind(io_, config_.data_port));

  Client vendors(io_);
  join(vendors, 0, connect({4, 4}, {0, 0}));
  publish();
  EXPECT_EQ(id_of(wait_for(vendors)), Message::kFrame);
  EXPECT_EQ(vendors.from().port(), config_.data_port);
  EXPECT_EQ(vendors.from().address(), asio::ip::address_v4::loopback());
  EXPECT_EQ(clients()[1].detail, "NatNetLib, bitstream 4.4, y-up m");
  EXPECT_EQ(clients()[1].frames_sent, 1U);
  EXPECT_FALSE(can_bind(io_, config_.data_port));

  vendors.send(message(Message::kDisconnect), server_->port());
  publish();
  EXPECT_EQ(id_of(ask(client_, message(Message::kRequestModel), server_->port())), Message::kFrame);
  publish();
  EXPECT_TRUE(can_bind(io_, config_.data_port)) << "it is free again without such a client";
}

TEST_F(NatNetServerTest, FramesLeaveFromAnotherPortWhileAProgramHasTheDataPort) {
  config_.multicast = false;
  const Client program(io_);
  config_.data_port = program.port();
  start();
  join(client_, 0, connect({4, 4}, {0, 0}));
  publish();
  EXPECT_EQ(id_of(wait_for(client_)), Message::kFrame);
  EXPECT_NE(client_.from().port(), config_.data_port);
}

TEST_F(NatNetServerTest, AnswersDiscoveryByBroadcastOnTheLoopback) {
  start();
  client_.socket().set_option(asio::socket_base::broadcast(true));
  client_.send(message(Message::kDiscovery, sender_block({3, 1})), server_->port(),
               "127.255.255.255");
  EXPECT_EQ(id_of(wait_for(client_)), Message::kServerInfo);
  EXPECT_EQ(client_.from().port(), server_->port());
}

TEST_F(NatNetServerTest, ForgetsAClientWhoseSocketIsClosed) {
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

TEST_F(NatNetServerTest, SendsAThousandBodiesInOneDatagram) {
  std::vector<std::string> names;
  for (int i = 0; i < 1000; ++i) names.push_back(std::to_string(i));
  frame_ = make_scene_frame(names);
  start();
  client_.socket().set_option(asio::socket_base::receive_buffer_size(1 << 20));
  join(client_, server_->second_port(), connect({4, 1}, {4, 1}));
  for (int i = 0; i < 20; ++i) {
    publish();
    EXPECT_EQ(wait_for(client_).size(), 126 + 38 * 1000U);
  }
}

TEST_F(NatNetServerTest, ServesMulticastAndUnicastOnTwoPorts) {
  start();
  ASSERT_NE(server_->second_port(), 0);
  const auto multicast_flag = [&](std::uint16_t port) {
    return ask(client_, ping(), port).at(kHeaderSize + 274);
  };
  EXPECT_EQ(multicast_flag(server_->port()), std::byte{1});
  EXPECT_EQ(multicast_flag(server_->second_port()), std::byte{0});
  config_.multicast = false;
  start();
  EXPECT_EQ(server_->second_port(), 0);
  EXPECT_EQ(multicast_flag(server_->port()), std::byte{0});
}

/// Bound to the port of the group, as the client of another program.
class Listener : public Client {
 public:
  explicit Listener(asio::io_context& io) : Client(io, asio::ip::address_v4::any(), true) {}
  [[nodiscard]] bool join(const std::string& group, const char* card) {
    boost::system::error_code error;
    socket().set_option(asio::ip::multicast::join_group(asio::ip::make_address_v4(group),
                                                        asio::ip::make_address_v4(card)),
                        error);
    return !error;
  }
  /// Datagrams that came, until none has come for 50 ms.
  std::size_t count(Bytes& last) {
    std::size_t n = 0;
    auto until = std::chrono::steady_clock::now() + kTimeout;
    while (std::chrono::steady_clock::now() < until) {
      Bytes datagram = take();
      if (datagram.empty()) continue;
      ++n;
      last = std::move(datagram);
      until = std::chrono::steady_clock::now() + std::chrono::milliseconds(50);
    }
    return n;
  }
};

TEST_F(NatNetServerTest, SendsToLocalGroupMembersOnEveryInterface) {
  for (const char* card : {"127.0.0.1", "0.0.0.0", ""}) {
    Listener listener(io_);
    // On a machine without any network the system knows no card for a group.
    if (*card != '\0' && !listener.join(config_.multicast_group, card)) continue;
    config_.data_port = listener.port();
    start();
    publish();
    Bytes frame;
    EXPECT_EQ(listener.count(frame), 1U) << "joined on " << card;
    ASSERT_GE(frame.size(), kHeaderSize);
    EXPECT_EQ(bodies_in(frame).size(), 2U);
  }
}

TEST_F(NatNetServerTest, SendsFramesToAGroupAmongTheTargets) {
  Listener listener(io_);
  config_.multicast = false;
  config_.targets = {"224.0.0.1:" + std::to_string(listener.port())};
  start();
  publish();
  Bytes frame;
  EXPECT_EQ(listener.count(frame), 1U);
  EXPECT_EQ(clients().at(0).peer, config_.targets[0] + " multicast");
}

}  // namespace
}  // namespace fiducap::natnet
