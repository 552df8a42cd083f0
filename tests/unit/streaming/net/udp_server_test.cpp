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

class DatagramBatchTest : public testing::Test {
 protected:
  udp::socket open() {
    return std::move(bind_udp(io_, {"127.0.0.1", 0, "streaming.test"}).value());
  }

  static std::string read(udp::socket& socket) {
    std::array<char, 64> text{};
    boost::system::error_code error;
    const auto n = socket.receive(boost::asio::buffer(text), 0, error);
    return error ? "" : std::string(text.data(), n);
  }

  static std::span<const std::byte> bytes(std::string_view text) {
    return std::as_bytes(std::span(text.data(), text.size()));
  }

  void add(std::string_view text, const udp::endpoint& to) {
    batch_.add(bytes(text), to.data(), static_cast<socklen_t>(to.size()));
  }

  boost::asio::io_context io_;
  udp::socket sender_{open()};
  udp::socket one_{open()};
  udp::socket two_{open()};
  DatagramBatch batch_;
};

TEST_F(DatagramBatchTest, EveryDatagramGoesToItsOwnAddress) {
  const auto to_one = one_.local_endpoint();
  const auto to_two = two_.local_endpoint();
  add("first", to_one);
  add("second", to_two);
  add("third", to_one);
  batch_.send(sender_.native_handle());
  EXPECT_TRUE(batch_.sent(0) && batch_.sent(1) && batch_.sent(2));
  EXPECT_EQ(read(one_), "first");
  EXPECT_EQ(read(one_), "third");
  EXPECT_EQ(read(two_), "second");
}

TEST_F(DatagramBatchTest, OneThatCannotGoDoesNotStopTheOthers) {
  const udp::endpoint nowhere(boost::asio::ip::address_v4::broadcast(),
                              9);  // not allowed without SO_BROADCAST
  const auto to_two = two_.local_endpoint();
  add("lost", nowhere);
  add("found", to_two);
  batch_.send(sender_.native_handle());
  EXPECT_FALSE(batch_.sent(0));
  EXPECT_TRUE(batch_.sent(1));
  EXPECT_EQ(read(two_), "found");
}

TEST_F(DatagramBatchTest, OneMessageIsCutIntoManyDatagrams) {
  const auto to_one = one_.local_endpoint();
  batch_.add_cut(bytes("aaaabbbbccccdd"), 4, to_one.data(), static_cast<socklen_t>(to_one.size()));
  add("next", to_one);
  EXPECT_EQ(batch_.size(), 2u);
  batch_.send(sender_.native_handle());
  EXPECT_TRUE(batch_.sent(0) && batch_.sent(1));
  for (const char* part : {"aaaa", "bbbb", "cccc", "dd", "next"}) EXPECT_EQ(read(one_), part);
}

TEST_F(DatagramBatchTest, CutsMoreDatagramsThanTheKernelTakesAtOnce) {
  const auto to_one = one_.local_endpoint();
  std::string text;
  for (int i = 0; i < 150; ++i) text += std::to_string(1000 + i);
  batch_.add_cut(bytes(text), 4, to_one.data(), static_cast<socklen_t>(to_one.size()));
  EXPECT_EQ(batch_.size(), 3u);
  batch_.send(sender_.native_handle());
  for (int i = 0; i < 150; ++i) EXPECT_EQ(read(one_), std::to_string(1000 + i));
}

TEST_F(DatagramBatchTest, WhatTheKernelCannotCutIsCutByHand) {
  const int on = 1;  // without checksums the kernel refuses to cut
  ASSERT_EQ(::setsockopt(sender_.native_handle(), SOL_SOCKET, SO_NO_CHECK, &on, sizeof(on)), 0);
  const auto to_one = one_.local_endpoint();
  batch_.add_cut(bytes("aaaabb"), 4, to_one.data(), static_cast<socklen_t>(to_one.size()));
  batch_.send(sender_.native_handle());
  EXPECT_TRUE(batch_.sent(0));
  EXPECT_EQ(read(one_), "aaaa");
  EXPECT_EQ(read(one_), "bb");
}

TEST_F(DatagramBatchTest, AllocatesNothingAfterTheFirstFrame) {
  const auto to_one = one_.local_endpoint();
  const auto frame = [&] {
    batch_.clear();
    for (int i = 0; i < 20; ++i) add("frame", to_one);
    batch_.send(sender_.native_handle());
  };
  frame();
  const AllocationCounter allocations;
  frame();
  EXPECT_EQ(allocations.count(), 0u);
}

using boost::asio::ip::udp;

std::span<const std::byte> bytes(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}
std::string text(std::span<const std::byte> data) {
  return {reinterpret_cast<const char*>(data.data()), data.size()};
}

class UdpServerTest : public testing::Test {
 protected:
  static constexpr std::size_t kLongest = 8;

  static UdpServer open(boost::asio::io_context& io) {
    return UdpServer::open(io, {"127.0.0.1", 0, "streaming.test"}, {"test", kLongest}).value();
  }
  void echo() {
    server_.start([this](const UdpServer::Datagram& datagram) {
      ++heard_;
      if (text(datagram.bytes) == "#") throw std::runtime_error("a handler's defect");
      server_.send(datagram.bytes, datagram.from, datagram.to);
    });
  }
  void say(std::string_view what) {
    client_.send_to(boost::asio::buffer(what.data(), what.size()),
                    {boost::asio::ip::address_v4::loopback(), server_.port()});
  }
  std::string read() {
    std::array<char, 64> answer{};
    boost::system::error_code error = boost::asio::error::would_block;
    std::size_t size = 0;
    while (error == boost::asio::error::would_block) {
      io_.poll();
      size = client_.receive(boost::asio::buffer(answer), 0, error);
    }
    return {answer.data(), size};
  }

  boost::asio::io_context io_;
  UdpServer server_{open(io_)};
  udp::socket client_{std::move(bind_udp(io_, {"127.0.0.1", 0, "streaming.test"}).value())};
  int heard_{0};
};

TEST_F(UdpServerTest, AnswersTheSender) {
  echo();
  say("hello");
  EXPECT_EQ(read(), "hello");
}

TEST_F(UdpServerTest, ALongerDatagramIsCut) {
  echo();
  say("0123456789");
  EXPECT_EQ(read(), "01234567");
}

TEST_F(UdpServerTest, WhatAHandlerThrowsCostsThatDatagramOnly) {
  echo();
  say("#");
  say("next");
  EXPECT_EQ(read(), "next") << "in the same turn";
  say("later");
  EXPECT_EQ(read(), "later") << "and in the next one";
  EXPECT_EQ(heard_, 3);
}

TEST_F(UdpServerTest, AFloodDoesNotKeepOtherWorkFromItsTurn) {
  echo();
  for (int i = 0; i < 200; ++i) say("x");
  io_.poll_one();
  io_.poll_one();
  EXPECT_LE(heard_, 128);
}

TEST_F(UdpServerTest, NothingIsCalledAfterItHasStopped) {
  echo();
  say("hello");
  server_.stop();
  io_.poll();
  EXPECT_EQ(heard_, 0);
  EXPECT_FALSE(server_.is_open());
}

TEST_F(UdpServerTest, NamesThePeersThatAreGone) {
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

TEST_F(UdpServerTest, ABatchAllocatesNothingAfterTheFirstFrame) {
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
