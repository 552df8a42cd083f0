#include "streaming/net/peer_user.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

namespace fiducap::net {
namespace {

/// Both ends of a connection to itself.
class PeerUser : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    const int family = GetParam() ? AF_INET6 : AF_INET;
    listener_ = ::socket(family, SOCK_STREAM, 0);
    SocketAddress at(GetParam() ? v6_loopback() : Peer{0x7f000001, 0}, !GetParam());
    if (listener_ < 0 || ::bind(listener_, at.data(), at.size()) != 0)
      GTEST_SKIP() << "this machine does not speak that protocol";
    ASSERT_EQ(::listen(listener_, 1), 0);
    SocketAddress bound = name_of(listener_);
    client_ = ::socket(family, SOCK_STREAM, 0);
    ASSERT_EQ(::connect(client_, bound.data(), bound.size()), 0);
    peer_ = name_of(client_).peer();
  }
  void TearDown() override {
    if (listener_ >= 0) ::close(listener_);
    if (client_ >= 0) ::close(client_);
  }
  static Peer v6_loopback() {
    Peer::Address address{};
    address.back() = 1;
    return {address, 0};
  }
  static SocketAddress name_of(int socket) {
    sockaddr_storage name{};
    socklen_t size = sizeof name;
    EXPECT_EQ(::getsockname(socket, reinterpret_cast<sockaddr*>(&name), &size), 0);
    return {reinterpret_cast<const sockaddr*>(&name), size};
  }

  int listener_{-1}, client_{-1};
  Peer peer_;
};

INSTANTIATE_TEST_SUITE_P(Versions, PeerUser, testing::Bool());

TEST_P(PeerUser, IsTheOneWhoseProgramConnected) {
  EXPECT_EQ(user_of(peer_), ::geteuid());
  EXPECT_TRUE(is_of_this_user(peer_));
}

TEST_P(PeerUser, OfNoConnectionIsNobody) {
  const Peer other = peer_.with_port(static_cast<std::uint16_t>(peer_.port ^ 1));
  EXPECT_EQ(user_of(other), std::nullopt);
  EXPECT_FALSE(is_of_this_user(other));
}

TEST_P(PeerUser, AnotherUserIsNot) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can be somebody else";
  const unsigned nobody = 65534;
  ASSERT_EQ(::fchown(client_, nobody, nobody), 0);  // a socket's user is that of its file
  EXPECT_EQ(user_of(peer_), nobody);
  EXPECT_FALSE(is_of_this_user(peer_));
}

}  // namespace
}  // namespace fiducap::net
