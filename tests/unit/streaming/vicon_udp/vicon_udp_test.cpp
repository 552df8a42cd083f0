// The layout is the one that public receivers read (TheWorkshopByGM/Vicon_UDP_Stream,
// yambati03/vicon_ros): little-endian, packed, zeros to the end of the block.
#include "streaming/vicon_udp/vicon_udp.hpp"

#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>

#include "base/bytes.hpp"
#include "streaming/vicon_udp/codec.hpp"
#include "support/allocation_counter.hpp"
#include "support/fake_clock.hpp"
#include "support/hex.hpp"
#include "support/loopback_socket.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vicon_udp {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr double kRounding_rad = 1e-12;

/// One object as a receiver reads it.
struct Item {
  std::string name;
  std::array<double, 3> p_mm{};
  std::array<double, 3> angles{};
};

/// What a receiver that shares no code with the encoder reads of one block.
struct Block {
  std::uint32_t frame{};
  std::vector<Item> items;
  bool rest_is_zero{true};

  explicit Block(std::span<const std::byte> bytes) {
    LittleEndianReader in(bytes);
    frame = in.u32();
    const int count = in.u8();
    for (int i = 0; i < count; ++i) {
      EXPECT_EQ(in.u8(), 0) << "an object";
      EXPECT_EQ(in.u16(), 72);
      const auto name = in.bytes(24);
      Item item{std::string(reinterpret_cast<const char*>(name.data())), {}, {}};
      for (double& x : item.p_mm) x = in.f64();
      for (double& a : item.angles) a = in.f64();
      items.push_back(item);
    }
    EXPECT_FALSE(in.failed());
    for (const std::byte one : in.bytes(in.left())) rest_is_zero &= one == std::byte{};
  }
  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const Item& one : items) all.push_back(one.name);
    return all;
  }
};

std::vector<Block> blocks(std::span<const std::byte> bytes, std::size_t size) {
  std::vector<Block> all;
  for (std::size_t at = 0; at < bytes.size(); at += size) all.emplace_back(bytes.subspan(at, size));
  return all;
}

TEST(BlockEncoder, WritesTheBytesThatReceiversExpect) {
  auto frame = make_scene_frame({"drone"}, 0x01020304);
  // A quarter turn about z.
  frame->bodies[0].X_WP = {Eigen::Quaterniond(std::sqrt(0.5), 0, 0, std::sqrt(0.5)),
                           {1.0, -2.0, 0.25}};
  BlockEncoder encoder(256, WhenInvalid::kStop, {});
  const auto bytes = encoder.encode(*frame);
  ASSERT_EQ(bytes.size(), 256U);
  const std::vector<std::byte> head(bytes.begin(), bytes.begin() + 56);
  EXPECT_EQ(to_hex(head), to_hex(from_hex("04030201 01 00 4800"
                                          "64726f6e65 00000000000000000000000000000000000000"
                                          "0000000000408f40 0000000000409fc0 0000000000406f40")));
  const Block block(bytes);
  EXPECT_NEAR(block.items[0].angles[0], 0, kRounding_rad);
  EXPECT_NEAR(block.items[0].angles[1], 0, kRounding_rad);
  EXPECT_NEAR(block.items[0].angles[2], std::acos(0.0), kRounding_rad);
  EXPECT_TRUE(block.rest_is_zero);
}

TEST(BlockEncoder, AnglesGiveTheAttitudeBack) {
  const auto frame = make_scene_frame({"drone"});
  BlockEncoder encoder(256, WhenInvalid::kStop, {});
  const auto [a, b, c] = Block(encoder.encode(*frame)).items[0].angles;
  using Eigen::AngleAxisd, Eigen::Vector3d;
  const Eigen::Quaterniond q = AngleAxisd(a, Vector3d::UnitX()) * AngleAxisd(b, Vector3d::UnitY()) *
                               AngleAxisd(c, Vector3d::UnitZ());
  EXPECT_LT(q.angularDistance(frame->bodies[0].X_WP.q), kRounding_rad);
}

TEST(BlockEncoder, MoreBodiesAreMoreBlocksOfOneFrame) {
  const auto frame = make_scene_frame(numbered_names(7), 9);
  for (const auto& [bytes, counts] :
       {std::pair(std::size_t{256}, std::vector<std::size_t>{3, 3, 1}),
        std::pair(std::size_t{512}, std::vector<std::size_t>{6, 1}),
        std::pair(std::size_t{1024}, std::vector<std::size_t>{7})}) {
    BlockEncoder encoder(bytes, WhenInvalid::kStop, {});
    std::vector<std::size_t> found;
    for (const Block& block : blocks(encoder.encode(*frame), bytes)) {
      EXPECT_EQ(block.frame, 9U);
      EXPECT_TRUE(block.rest_is_zero);
      found.push_back(block.items.size());
    }
    EXPECT_EQ(found, counts) << bytes;
  }
}

TEST(BlockEncoder, AnInvalidBodyIsAbsentOrHeld) {
  auto frame = make_scene_frame({"arm", "drone"});
  BlockEncoder stop(256, WhenInvalid::kStop, {});
  BlockEncoder hold(256, WhenInvalid::kHold, {});
  const double before = Block(hold.encode(*frame)).items[0].p_mm[0];
  frame->bodies[0].valid = false;
  frame->bodies[0].X_WP.p.x() = 7;
  EXPECT_THAT(Block(stop.encode(*frame)).names(), ElementsAre("drone"));
  EXPECT_EQ(Block(hold.encode(*frame)).items[0].p_mm[0], before);
  frame->bodies[1].X_WP.p.x() = std::nan("");
  EXPECT_THAT(stop.encode(*frame), IsEmpty()) << "nothing that a receiver could take for a pose";
  ++frame->axes;
  EXPECT_THAT(hold.encode(*frame), IsEmpty()) << "held poses are of other axes";
}

TEST(BlockEncoder, NamesFitTheirFieldAndFollowTheModel) {
  auto frame = make_scene_frame({"a-name-of-far-more-than-23-bytes", "arm"});
  BlockEncoder encoder(256, WhenInvalid::kStop, {{"arm", "Rigid Body"}});
  EXPECT_THAT(Block(encoder.encode(*frame)).names(),
              ElementsAre("a_name_of_far_more_than", "Rigid_Body"));
  auto model = std::make_shared<SceneModel>(*frame->model);
  ++model->generation;
  model->bodies[0].name = "rover";
  frame->model = model;
  EXPECT_THAT(Block(encoder.encode(*frame)).names(), ElementsAre("rover", "Rigid_Body"));
}

TEST(BlockEncoder, AllocatesNothingOnceWarm) {
  const auto frame = make_scene_frame(numbered_names(20));
  BlockEncoder encoder(256, WhenInvalid::kHold, {});
  ASSERT_FALSE(encoder.encode(*frame).empty());
  const AllocationCounter counter;
  for (int i = 0; i < 10; ++i) ASSERT_FALSE(encoder.encode(*frame).empty());
  EXPECT_EQ(counter.count(), 0);
}

TEST(ViconUdpConfig, ReportsEveryBrokenRule) {
  ViconUdpConfig config;
  EXPECT_THAT(config.check(), IsEmpty());
  config.targets = {"10.0.0.7", "10.0.0.7:0", "239.1.1.1:51001", "192.168.1.255:51001"};
  config.block_bytes = 300;
  config.when_invalid = WhenInvalid::kFlag;
  EXPECT_THAT(config.check(), testing::SizeIs(5));
}

TEST(ViconUdpServer, SendsEachFrameToEveryTarget) {
  const int one = bound_socket(SOCK_DGRAM);
  const int other = bound_socket(SOCK_DGRAM);
  ViconUdpConfig config;
  config.targets = {"127.0.0.1:" + std::to_string(port_of(one)),
                    "127.0.0.1:" + std::to_string(port_of(other))};
  boost::asio::io_context io;
  FakeClock clock;
  const auto frame = make_scene_frame(numbered_names(4));
  auto server = serve({.io = io, .model = frame->model, .clock = clock, .rate_hz = 100}, config);
  ASSERT_TRUE(server) << server.error().text();
  (*server)->publish(frame);
  for (const int fd : {one, other}) {
    for (const std::size_t items : {3U, 1U}) {
      const auto datagram = read_datagram(fd);
      ASSERT_TRUE(datagram);
      EXPECT_EQ(datagram->size(), 256U);
      EXPECT_EQ(Block(*datagram).items.size(), items);
    }
    EXPECT_FALSE(read_datagram(fd));
  }
  std::vector<ClientStatus> clients;
  (*server)->append_clients(clients);
  ASSERT_EQ(clients.size(), 2U);
  EXPECT_EQ(clients[0].frames_sent, 1U);
  EXPECT_EQ(clients[0].peer, config.targets[0] + " udp");
  (*server)->stop();
  (*server)->publish(frame);
  EXPECT_FALSE(read_datagram(one));
  ::close(one);
  ::close(other);
}

}  // namespace
}  // namespace fiducap::vicon_udp
