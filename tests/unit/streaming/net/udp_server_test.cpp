#include <gtest/gtest.h>

#include <array>
#include <stdexcept>
#include <string>

#include "streaming/net/bind.hpp"
#include "streaming/net/udp_server.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap::net {
namespace {

using boost::asio::ip::udp;

udp::socket open_socket(boost::asio::io_context& io) {
  return std::move(bind_udp(io, {"127.0.0.1", 0, "streaming.test"}).value());
}
std::span<const std::byte> bytes(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}
std::string read_now(udp::socket& socket, boost::system::error_code& error) {
  std::array<char, 64> text{};
  const auto n = socket.receive(boost::asio::buffer(text), 0, error);
  return {text.data(), n};
}

class DatagramBatchTest : public testing::Test {
 protected:
  static std::string read(udp::socket& socket) {
    boost::system::error_code error;
    return read_now(socket, error);
  }
  void add(std::string_view text, const udp::endpoint& to) {
    batch_.add(bytes(text), SocketAddress(to.data(), static_cast<socklen_t>(to.size())));
  }
  /// Of four bytes each, to `one_`.
  void add_cut(std::string_view text) {
    batch_.add_cut(bytes(text), 4,
                   SocketAddress(to_one_.data(), static_cast<socklen_t>(to_one_.size())));
  }
  void send() { batch_.send(sender_.native_handle()); }

  boost::asio::io_context io_;
  udp::socket sender_{open_socket(io_)};
  udp::socket one_{open_socket(io_)};
  udp::socket two_{open_socket(io_)};
  const udp::endpoint to_one_{one_.local_endpoint()};
  const udp::endpoint to_two_{two_.local_endpoint()};
  DatagramBatch batch_;
};

TEST_F(DatagramBatchTest, SendsEachDatagramToItsAddressThoughOneFails) {
  const udp::endpoint broadcast(boost::asio::ip::address_v4::broadcast(), 9);
  add("first", to_one_);
  add("second", to_two_);
  add("lost", broadcast);  // not allowed without SO_BROADCAST
  add("third", to_one_);
  send();
  EXPECT_TRUE(batch_.sent(0) && batch_.sent(1) && !batch_.sent(2) && batch_.sent(3));
  EXPECT_EQ(read(one_), "first");
  EXPECT_EQ(read(one_), "third");
  EXPECT_EQ(read(two_), "second");
}

TEST_F(DatagramBatchTest, CutsAMessageIntoDatagrams) {
  add_cut("aaaabbbbccccdd");
  add("next", to_one_);
  EXPECT_EQ(batch_.size(), 2u);
  send();
  EXPECT_TRUE(batch_.sent(0) && batch_.sent(1));
  for (const char* part : {"aaaa", "bbbb", "cccc", "dd", "next"}) EXPECT_EQ(read(one_), part);
}

TEST_F(DatagramBatchTest, CutsMoreDatagramsThanTheKernelTakesAtOnce) {
  std::string text;
  for (int i = 0; i < 150; ++i) text += std::to_string(1000 + i);
  add_cut(text);
  EXPECT_EQ(batch_.size(), 3u);
  send();
  for (int i = 0; i < 150; ++i) EXPECT_EQ(read(one_), std::to_string(1000 + i));
}

TEST_F(DatagramBatchTest, CutsByItselfWhereTheKernelRefuses) {
  const int on = 1;  // without checksums the kernel refuses to cut
  ASSERT_EQ(::setsockopt(sender_.native_handle(), SOL_SOCKET, SO_NO_CHECK, &on, sizeof(on)), 0);
  add_cut("aaaabb");
  send();
  EXPECT_TRUE(batch_.sent(0));
  EXPECT_EQ(read(one_), "aaaa");
  EXPECT_EQ(read(one_), "bb");
}

class UdpServerTest : public testing::Test {
 protected:
  static constexpr std::size_t kLongest = 8;

  static UdpServer open(boost::asio::io_context& io) {
    return UdpServer::open(io, {"127.0.0.1", 0, "streaming.test"}, {"test", kLongest}).value();
  }
  void echo() {
    server_.start([this](const UdpServer::Datagram& datagram) {
      ++received_;
      if (datagram.bytes.front() == std::byte{'#'}) throw std::runtime_error("a handler's defect");
      server_.send(datagram.bytes, datagram.from, datagram.to);
    });
  }
  void send(std::string_view text) {
    client_.send_to(boost::asio::buffer(text.data(), text.size()),
                    {boost::asio::ip::address_v4::loopback(), server_.port()});
  }
  std::string read() {
    boost::system::error_code error = boost::asio::error::would_block;
    std::string text;
    while (error == boost::asio::error::would_block) {
      io_.poll();
      text = read_now(client_, error);
    }
    return text;
  }

  boost::asio::io_context io_;
  UdpServer server_{open(io_)};
  udp::socket client_{open_socket(io_)};
  int received_{0};
};

TEST_F(UdpServerTest, RepliesToTheSenderAndCutsALongerDatagram) {
  echo();
  send("hello");
  EXPECT_EQ(read(), "hello");
  send("0123456789");
  EXPECT_EQ(read(), "01234567");
}

TEST_F(UdpServerTest, ExceptionOfAHandlerAffectsItsDatagramOnly) {
  echo();
  send("#");
  send("next");
  EXPECT_EQ(read(), "next") << "in the same turn";
  send("later");
  EXPECT_EQ(read(), "later") << "in the next turn";
  EXPECT_EQ(received_, 3);
}

TEST_F(UdpServerTest, FloodLeavesTimeForOtherTasks) {
  echo();
  for (int i = 0; i < 200; ++i) send("x");
  io_.poll_one();
  io_.poll_one();
  EXPECT_LE(received_, 128);
}

TEST_F(UdpServerTest, CallsNothingAfterStop) {
  echo();
  send("hello");
  server_.stop();
  io_.poll();
  EXPECT_EQ(received_, 0);
  EXPECT_FALSE(server_.is_open());
}

TEST_F(UdpServerTest, ReportsPeersThatRefuse) {
  UdpOptions options{"test"};
  options.reports_refusals = true;
  auto sender = UdpServer::open(io_, {"127.0.0.1", 0, "streaming.test"}, options).value();
  const Peer gone{0x7f000001, client_.local_endpoint().port()};
  client_.close();
  sender.add(bytes("lost"), gone);
  sender.send_batch();
  std::optional<Peer> refused;
  for (int i = 0; i < 100'000 && !refused; ++i) refused = sender.next_refused();
  EXPECT_EQ(refused, gone);
}

TEST_F(UdpServerTest, BatchAllocatesNothingAfterTheFirstFrame) {
  const Peer to{0x7f000001, client_.local_endpoint().port()};
  const auto frame = [&] {
    server_.batch().clear();
    for (int i = 0; i < 20; ++i) server_.add(bytes("frame"), to);
    server_.send_batch();
  };
  frame();
  const AllocationCounter allocations;
  frame();
  EXPECT_EQ(allocations.count(), 0u);
}

}  // namespace
}  // namespace fiducap::net
