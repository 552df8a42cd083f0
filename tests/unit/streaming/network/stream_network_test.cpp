// VRPN, Vicon and Qualisys over connections that deliver late, in pieces cut anywhere, and break;
// in virtual time.
#include <gtest/gtest.h>

#include <functional>
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

/// The server's and the client's end of one kind of connection, replaced when it breaks.
class Ends {
 public:
  virtual ~Ends() = default;
  virtual void connect(Instant now, Bytes& to_client, Bytes& to_server) = 0;
  /// Bytes of the client, cut anywhere. @return what broke the framing
  virtual std::optional<std::string> serve(std::span<const std::byte> bytes, Instant now,
                                           Bytes& to_client) = 0;
  virtual void publish(const std::shared_ptr<const SceneFrame>& frame, Instant now,
                       Bytes& to_client) = 0;
  /// All that the client has of this connection and not yet read; it takes off whole messages.
  /// @return the frame's mark for each frame in it: larger for newer ones
  virtual std::vector<std::uint64_t> read(Bytes& received) = 0;
};

class StreamNetwork {
 public:
  StreamNetwork(std::uint32_t seed, Ends& ends)
      : random_(seed),
        bad_(from_seconds(1e-3 * static_cast<double>(random_() % 700))),
        ends_(ends) {
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
      const auto wrong = ends_.serve(piece, now_, out);
      ASSERT_FALSE(wrong) << *wrong;
    }
    auto frame = make_scene_frame(kNames, ++number_);
    frame->at = frame->published_at = now_;
    ends_.publish(frame, now_, out);
    down_->send(out, now_);
    for (Bytes piece = down_->receive(now_); !piece.empty(); piece = down_->receive(now_))
      received_.insert(received_.end(), piece.begin(), piece.end());
    for (const std::uint64_t mark : ends_.read(received_)) {
      ASSERT_GT(mark, newest_) << "a frame twice, or after a newer one";
      newest_ = mark;
      ++frames_;
    }
  }

  std::mt19937 random_;
  Duration bad_;
  Ends& ends_;
  std::unique_ptr<FaultyStream> up_;
  std::unique_ptr<FaultyStream> down_;
  Bytes received_;
  Instant now_ = instant_from_ns(1'000'000'000'000);
  std::uint64_t number_{0};
  std::uint64_t newest_{0};
  int frames_{0};
};

class ViconEnds final : public Ends {
 public:
  void connect(Instant now, Bytes& to_client, Bytes& to_server) override {
    connection_.emplace(profiles_, now);
    to_client = connection_->greeting();
    to_server = vicon::client::types(vicon::client::kSegments);
    const Bytes push = vicon::client::request_frame(true);
    to_server.insert(to_server.end(), push.begin(), push.end());
    greeting_ = to_client.size();
  }
  std::optional<std::string> serve(std::span<const std::byte> bytes, Instant now,
                                   Bytes& to_client) override {
    const auto done = connection_->receive(bytes, now, to_client);
    return done ? std::nullopt : std::optional(done.error().text());
  }
  void publish(const std::shared_ptr<const SceneFrame>& frame, Instant now,
               Bytes& to_client) override {
    board_.update(*frame, now);
    if (!connection_->open() || !connection_->wants(board_.id())) return;
    const auto version = board_.statics_version();
    const bool statics = connection_->wants_statics(version);
    const auto packet = board_.packet(connection_->profile(), statics, now);
    to_client.insert(to_client.end(), packet->begin(), packet->end());
    connection_->sent(board_.id(), version);
  }
  std::vector<std::uint64_t> read(Bytes& received) override {
    std::vector<std::uint64_t> marks;
    while (received.size() >= 8) {
      LittleEndianReader in(received);
      EXPECT_EQ(in.u32(), 0x1A2B0001u);
      const std::size_t size = 8 + in.u32();
      if (received.size() < size) break;
      if (greeting_ == 0) marks.push_back(++packets_);
      greeting_ = 0;
      received.erase(received.begin(), received.begin() + static_cast<std::ptrdiff_t>(size));
    }
    return marks;
  }

 private:
  vicon::ProfileTable profiles_;
  vicon::FrameBoard board_{WhenInvalid::kFlag};
  std::optional<vicon::Connection> connection_;
  std::size_t greeting_{0};
  std::uint64_t packets_{0};
};

class QualisysEnds final : public Ends {
 public:
  QualisysEnds() { shared_.bodies.update(*make_scene_frame(kNames)->model); }

  void connect(Instant, Bytes& to_client, Bytes& to_server) override {
    if (connection_) connection_->leave();
    connection_.emplace(shared_, qualisys::Dialect::kLittleEndian, ++id_, "10.0.0.7", 4711);
    connection_->greet(to_client);
    for (const char* words : {"Version 1.23", "GetParameters 6D", "StreamFrames AllFrames 6D"})
      encode_text(std::endian::little, qualisys::PacketType::kCommand, words, to_server);
  }
  std::optional<std::string> serve(std::span<const std::byte> bytes, Instant,
                                   Bytes& to_client) override {
    const auto done = connection_->receive(bytes, to_client);
    return done ? std::nullopt : std::optional(done.error().text());
  }
  void publish(const std::shared_ptr<const SceneFrame>& frame, Instant, Bytes& to_client) override {
    shared_.frames.put(frame, shared_.bodies);
    shared_.rate_hz = frame->rate_hz;
    const auto profile = connection_->stream_of(*frame);
    if (!profile) return;
    const auto encoded = shared_.frames.encoded(*profile);
    to_client.insert(to_client.end(), encoded->packet.begin(), encoded->packet.end());
  }
  std::vector<std::uint64_t> read(Bytes& received) override {
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
      received.erase(received.begin(),
                     received.begin() + static_cast<std::ptrdiff_t>((*packet)->size));
    }
  }

 private:
  qualisys::SharedState shared_{qualisys::QualisysConfig{}, nullptr};
  std::optional<qualisys::Connection> connection_;
  std::uint64_t id_{0};
};

class VrpnEnds final : public Ends {
 public:
  VrpnEnds() { senders_.update(*make_scene_frame(kNames)->model); }

  void connect(Instant, Bytes& to_client, Bytes& to_server) override {
    connection_.emplace(config_, senders_, vrpn::Origin::kDirect);
    to_client = connection_->greeting();
    to_server = vrpn::hello();
    cookie_ = false;
  }
  std::optional<std::string> serve(std::span<const std::byte> bytes, Instant,
                                   Bytes& to_client) override {
    const auto done = connection_->receive(bytes, vrpn::kNow_ns, to_client);
    return done ? std::nullopt : std::optional(done.error().text());
  }
  void publish(const std::shared_ptr<const SceneFrame>& frame, Instant, Bytes& to_client) override {
    if (!connection_->open()) return;
    encoder_.encode(*frame, senders_.of_bodies(), {}, encoded_);
    to_client.insert(to_client.end(), encoded_.bytes.begin(), encoded_.bytes.end());
  }
  /// Frames are identified by the time of their first report; other messages are skipped.
  std::vector<std::uint64_t> read(Bytes& received) override {
    std::vector<std::uint64_t> marks;
    if (!cookie_) {
      const std::size_t cookie = vrpn::golden("cookie").size();
      if (received.size() < cookie) return marks;
      received.erase(received.begin(), received.begin() + static_cast<std::ptrdiff_t>(cookie));
      cookie_ = true;
    }
    while (received.size() >= 24) {
      BigEndianReader in(received);
      const std::size_t size = 24 + (in.u32() - 24 + 7) / 8 * 8;
      const std::uint64_t at_us = in.u32() * std::uint64_t{1'000'000} + in.u32();
      const auto sender = in.i32();
      const auto type = in.i32();
      if (received.size() < size) break;
      const bool is_pose = type == static_cast<std::int32_t>(vrpn::Type::kPosQuat) &&
                           sender == senders_.of_bodies().front();
      if (is_pose) marks.push_back(at_us);
      received.erase(received.begin(), received.begin() + static_cast<std::ptrdiff_t>(size));
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

template <class TheEnds>
void try_all_seeds() {
  for (std::uint32_t seed = 1; seed <= seeds(300); ++seed) {
    TheEnds ends;
    StreamNetwork network(seed, ends);
    network.suffer();
    ASSERT_FALSE(testing::Test::HasFailure()) << "seed " << seed;
    network.heal();
    ASSERT_LT(network.wait_for_frames(20, 2s), 1s) << "seed " << seed;
    ASSERT_FALSE(testing::Test::HasFailure()) << "seed " << seed;
  }
}

TEST(ViconNetwork, PiecesDelaysAndBrokenConnectionsDoNoHarm) { try_all_seeds<ViconEnds>(); }
TEST(QualisysNetwork, PiecesDelaysAndBrokenConnectionsDoNoHarm) { try_all_seeds<QualisysEnds>(); }
TEST(VrpnNetwork, PiecesDelaysAndBrokenConnectionsDoNoHarm) { try_all_seeds<VrpnEnds>(); }

}  // namespace
}  // namespace fiducap
