#include "streaming/net/datagram_batch.hpp"

#include <gtest/gtest.h>

#include <array>

#include "streaming/net/bind.hpp"
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

}  // namespace
}  // namespace fiducap::net
