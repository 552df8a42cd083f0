#include "streaming/net/udp_server.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "streaming/net/bind.hpp"
#include "support/allocation_counter.hpp"

namespace fiducap::net {
namespace {

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
