// VRPN, Vicon and Qualisys over connections that delay, fragment and break, in virtual time.
#include <gtest/gtest.h>

#include <memory>

#include "../vicon/client_packets.hpp"
#include "../vrpn/connection_fixture.hpp"
#include "base/bytes.hpp"
#include "streaming/qualisys/codec.hpp"
#include "streaming/qualisys/session.hpp"
#include "streaming/vicon/frame_board.hpp"
#include "streaming/vicon/session.hpp"
#include "streaming/vrpn/codec.hpp"
#include "support/faulty_link.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::byte>;

constexpr Duration kStep = 10ms;
const std::vector<std::string> kNames{"arm", "drone"};

void append(Bytes& to, std::span<const std::byte> bytes) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}
void drop_front(Bytes& from, std::size_t size) {
  from.erase(from.begin(), from.begin() + static_cast<std::ptrdiff_t>(size));
}

/// Server and client over a connection that is replaced when it breaks.
/// @tparam Ends  of one protocol, with
///   connect(now, to_client, to_server)  a new connection and its first bytes
///   serve(bytes, now, to_client)        bytes of the client, cut anywhere. @return framing error
///   publish(frame, now, to_client)
///   read(received)                      removes whole messages from what the client has received.
///                                       @return a mark for each frame, larger for newer ones
template <class Ends>
class StreamNetwork {
 public:
  explicit StreamNetwork(std::uint32_t seed)
      : random_(seed), bad_(from_seconds(1e-3 * static_cast<double>(random_() % 700))) {
    connect();
  }
  void suffer() {
    for (int i = 0; i < 300; ++i) {
      if (random_() % 60 == 0) connect();
      step();
      if (testing::Test::HasFatalFailure()) return;
    }
  }
  void heal() {
    bad_ = {};
    connect();
  }
  Duration wait_for_frames(int wanted, Duration timeout) {
    const Instant begin = now_;
    const int before = frames_;
    while (frames_ < before + wanted && now_ - begin < timeout) step();
    return now_ - begin;
  }

 private:
  void connect() {
    up_ = std::make_unique<FaultyStream>(random_, bad_);
    down_ = std::make_unique<FaultyStream>(random_, bad_);
    received_.clear();
    newest_ = 0;
    Bytes to_client;
    Bytes to_server;
    ends_.connect(now_, to_client, to_server);
    down_->send(to_client, now_);
    up_->send(to_server, now_);
  }
  void step() {
    now_ += kStep;
    Bytes out;
    if (const Bytes piece = up_->receive(now_); !piece.empty()) {
      const auto served = ends_.serve(piece, now_, out);
      ASSERT_TRUE(served) << served.error().text();
    }
    auto frame = make_scene_frame(kNames, ++number_);
    frame->at = frame->published_at = now_;
    ends_.publish(frame, now_, out);
    down_->send(out, now_);
    for (Bytes piece = down_->receive(now_); !piece.empty(); piece = down_->receive(now_))
      append(received_, piece);
    for (const std::uint64_t mark : ends_.read(received_)) {
      ASSERT_GT(mark, newest_) << "a frame again, or after a newer one";
      newest_ = mark;
      ++frames_;
    }
  }

  std::mt19937 random_;
  Duration bad_;
  Ends ends_;
  std::unique_ptr<FaultyStream> up_;
  std::unique_ptr<FaultyStream> down_;
  Bytes received_;
  Instant now_ = instant_from_ns(1'000'000'000'000);
  std::uint64_t number_{0};
  std::uint64_t newest_{0};
  int frames_{0};
};

class ViconEnds {
 public:
  void connect(Instant now, Bytes& to_client, Bytes& to_server) {
    connection_.emplace(profiles_, now);
    to_client = connection_->greeting();
    to_server = vicon::client::types(vicon::client::kSegments);
    append(to_server, vicon::client::request_frame(true));
    greeting_ = to_client.size();
  }
  Expected<void> serve(std::span<const std::byte> bytes, Instant now, Bytes& to_client) {
    return connection_->receive(bytes, now, to_client);
  }
  void publish(const std::shared_ptr<const SceneFrame>& frame, Instant now, Bytes& to_client) {
    board_.update(*frame, now);
    if (!connection_->open() || !connection_->wants(board_.id())) return;
    const auto version = board_.statics_version();
    const bool statics = connection_->wants_statics(version);
    append(to_client, *board_.packet(connection_->profile(), statics, now));
    connection_->sent(board_.id(), version);
  }
  std::vector<std::uint64_t> read(Bytes& received) {
    std::vector<std::uint64_t> marks;
    while (received.size() >= 8) {
      LittleEndianReader in(received);
      EXPECT_EQ(in.u32(), 0x1A2B0001u);
      const std::size_t size = 8 + in.u32();
      if (received.size() < size) break;
      if (greeting_ == 0) marks.push_back(++packets_);
      greeting_ = 0;
      drop_front(received, size);
    }
    return marks;
  }

 private:
  vicon::FrameBoard board_{WhenInvalid::kFlag};
  vicon::ProfileTable profiles_;
  std::optional<vicon::Connection> connection_;
  std::size_t greeting_{0};
  std::uint64_t packets_{0};
};

class QualisysEnds {
 public:
  QualisysEnds() { shared_.bodies.update(*make_scene_frame(kNames)->model); }

  void connect(Instant, Bytes& to_client, Bytes& to_server) {
    if (connection_) connection_->leave();
    connection_.emplace(shared_, qualisys::Dialect::kLittleEndian, ++id_, "10.0.0.7", 4711);
    connection_->greet(to_client);
    for (const char* words : {"Version 1.23", "GetParameters 6D", "StreamFrames AllFrames 6D"})
      encode_text(std::endian::little, qualisys::PacketType::kCommand, words, to_server);
  }
  Expected<void> serve(std::span<const std::byte> bytes, Instant, Bytes& to_client) {
    return connection_->receive(bytes, to_client);
  }
  void publish(const std::shared_ptr<const SceneFrame>& frame, Instant, Bytes& to_client) {
    shared_.frames.put(frame, shared_.bodies);
    shared_.rate_hz = frame->rate_hz;
    if (const auto profile = connection_->stream_of(*frame))
      append(to_client, shared_.frames.encoded(*profile)->packet);
  }
  std::vector<std::uint64_t> read(Bytes& received) {
    std::vector<std::uint64_t> marks;
    for (;;) {
      const auto packet = qualisys::decode_packet(std::endian::little, received);
      EXPECT_TRUE(packet);
      if (!packet || !*packet) return marks;
      if ((*packet)->type == qualisys::PacketType::kData) {
        LittleEndianReader in((*packet)->payload);
        in.bytes(8);
        marks.push_back(in.u32());
      }
      drop_front(received, (*packet)->size);
    }
  }

 private:
  qualisys::SharedState shared_{qualisys::QualisysConfig{}, nullptr};
  std::optional<qualisys::Connection> connection_;
  std::uint64_t id_{0};
};

class VrpnEnds {
 public:
  VrpnEnds() { senders_.update(*make_scene_frame(kNames)->model); }

  void connect(Instant, Bytes& to_client, Bytes& to_server) {
    connection_.emplace(config_, senders_, vrpn::Origin::kDirect);
    to_client = connection_->greeting();
    to_server = vrpn::hello();
    cookie_ = false;
  }
  Expected<void> serve(std::span<const std::byte> bytes, Instant, Bytes& to_client) {
    return connection_->receive(bytes, vrpn::kNow_ns, to_client);
  }
  void publish(const std::shared_ptr<const SceneFrame>& frame, Instant, Bytes& to_client) {
    if (!connection_->open()) return;
    encoder_.encode(*frame, senders_.of_bodies(), {}, encoded_);
    append(to_client, encoded_.bytes);
  }
  /// Frames are identified by the time of their first report; other messages are skipped.
  std::vector<std::uint64_t> read(Bytes& received) {
    std::vector<std::uint64_t> marks;
    if (!cookie_) {
      const std::size_t cookie = vrpn::golden("cookie").size();
      if (received.size() < cookie) return marks;
      drop_front(received, cookie);
      cookie_ = true;
    }
    while (received.size() >= 24) {
      BigEndianReader in(received);
      const std::size_t size = 24 + (in.u32() - 24 + 7) / 8 * 8;
      const std::uint64_t at_us = in.u32() * std::uint64_t{1'000'000} + in.u32();
      const auto sender = in.i32();
      const auto type = in.i32();
      if (received.size() < size) break;
      if (type == static_cast<std::int32_t>(vrpn::Type::kPosQuat) &&
          sender == senders_.of_bodies().front())
        marks.push_back(at_us);
      drop_front(received, size);
    }
    return marks;
  }

 private:
  vrpn::VrpnConfig config_;
  vrpn::SenderTable senders_;
  vrpn::ReportEncoder encoder_{config_.axes(), {}};
  vrpn::EncodedFrame encoded_;
  std::optional<vrpn::Connection> connection_;
  bool cookie_{false};
};

template <class Ends>
void try_all_seeds() {
  for (std::uint32_t seed = 1; seed <= seeds(); ++seed) {
    StreamNetwork<Ends> network(seed);
    network.suffer();
    ASSERT_FALSE(testing::Test::HasFailure()) << "seed " << seed;
    network.heal();
    ASSERT_LT(network.wait_for_frames(20, 2s), 1s) << "seed " << seed;
    ASSERT_FALSE(testing::Test::HasFailure()) << "seed " << seed;
  }
}

TEST(ViconNetwork, DeliversFramesInOrderDespiteFragmentsAndBreaks) { try_all_seeds<ViconEnds>(); }
TEST(QualisysNetwork, DeliversFramesInOrderDespiteFragmentsAndBreaks) {
  try_all_seeds<QualisysEnds>();
}
TEST(VrpnNetwork, DeliversFramesInOrderDespiteFragmentsAndBreaks) { try_all_seeds<VrpnEnds>(); }

}  // namespace
}  // namespace fiducap
