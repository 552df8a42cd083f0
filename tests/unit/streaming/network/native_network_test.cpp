// The server's registry and encoder with the SDK's conversation and assembler.
#include <gtest/gtest.h>

#include <memory>

#include "datagram_network.hpp"
#include "src/codec.hpp"
#include "src/conversation.hpp"
#include "src/frame_assembler.hpp"
#include "streaming/native/codec.hpp"
#include "streaming/native/frames.hpp"
#include "streaming/native/registry.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::native {
namespace {

using namespace std::chrono_literals;

constexpr Duration kStep = 5ms;
constexpr int kStepsPerFrame = 4;
const std::vector<std::string> kNames{"a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l"};

/// One run of a server.
struct ServerRun {
  Registry registry;
  FrameEncoder encoder;
  std::vector<Datagram> model;
};

/// The server, and the SDK without its socket and thread.
class NativeNetwork : public DatagramNetwork {
 public:
  explicit NativeNetwork(std::uint32_t seed)
      : DatagramNetwork(seed), conversation_(500 * sdk::kMillisecond, random_(), "network test") {
    restart();
    conversation_.start(now_ns());
  }
  /// Some seconds on the bad network; the server may restart, the client's port may change.
  void suffer() {
    const int steps = 200 + static_cast<int>(random_() % 400);
    for (int i = 0; i < steps; ++i) {
      if (random_() % 1000 == 0) restart();
      if (random_() % 200 == 0) ++peer_.port;  // as with an address translator
      step();
    }
  }
  [[nodiscard]] std::size_t clients() const { return server_->registry.subscribers().size(); }

 private:
  [[nodiscard]] sdk::Nanoseconds now_ns() const { return now_.time_since_epoch().count(); }

  void restart() {
    ++session_;
    frame_->number = 0;
    server_.reset(new ServerRun{Registry({}, {random_(), random_()}, session_),
                                FrameEncoder(session_), encode_model(session_, *frame_->model)});
  }
  void step() override {
    now_ += kStep;
    request();
    while (const auto datagram = up_.receive(now_)) reply(*datagram);
    if (++steps_ % kStepsPerFrame == 0) publish();
    while (const auto datagram = down_.receive(now_)) {
      if (const Frame* frame = decode(*datagram)) show(*frame);
    }
  }
  void request() {
    conversation_.tick(now_ns());
    if (!conversation_.due(now_ns())) return;
    const bool same_run = conversation_.session() == client_session_;
    const auto bytes =
        sdk::encode(conversation_.question(same_run ? assembler_.model_generation() : 0, now_ns()));
    up_.send(std::as_bytes(std::span(bytes)), now_);
  }
  void reply(std::span<const std::byte> datagram) {
    const auto answer = server_->registry.receive(datagram, peer_, frame_->model->generation, now_);
    if (!answer.datagram.empty()) down_.send(answer.datagram, now_);
    if (!answer.send_model) return;
    for (const auto& part : server_->model) down_.send(part, now_);
  }
  /// Datagrams for former ports of the client are lost.
  void publish() {
    (void)server_->registry.expire(now_);
    ++frame_->number;
    frame_->at = frame_->published_at = now_;
    for (const auto& one : server_->registry.subscribers()) {
      if (one.peer != peer_) continue;
      for (const auto& datagram : server_->encoder.encode(*frame_)) down_.send(datagram, now_);
    }
  }
  /// @return the frame that is complete with this datagram
  const Frame* decode(std::span<const std::byte> datagram) {
    using Kind = sdk::MessageKind;
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(datagram.data());
    const Kind kind = decoder_.decode(bytes, datagram.size());
    if (kind == Kind::kChallenge) conversation_.on(decoder_.challenge(), now_ns());
    if (kind == Kind::kNotice) conversation_.on(decoder_.notice(), now_ns());
    if (kind == Kind::kLease && conversation_.on(decoder_.lease(), now_ns())) {
      if (conversation_.session() != client_session_) assembler_.begin(conversation_.session());
      client_session_ = conversation_.session();
    }
    if (kind == Kind::kModel && conversation_.heard(decoder_.model().session, now_ns()))
      assembler_.add(decoder_.model());
    if (kind == Kind::kFrame && conversation_.heard(decoder_.frame().session, now_ns()))
      return assembler_.add(decoder_.frame());
    return nullptr;
  }
  void show(const Frame& frame) {
    ++frames_;
    ASSERT_EQ(frame.bodies.size(), kNames.size()) << "not whole";
    ASSERT_GT(frame.at_server_ns, newest_) << "shown again, or after a newer one";
    newest_ = frame.at_server_ns;
  }

  std::shared_ptr<SceneFrame> frame_ = make_scene_frame(kNames);
  std::unique_ptr<ServerRun> server_;
  sdk::Conversation conversation_;
  sdk::Decoder decoder_;
  sdk::FrameAssembler assembler_;
  std::uint64_t client_session_{0};
  std::uint64_t session_{0};
  std::uint64_t steps_{0};
  std::int64_t newest_{0};
};

// Three seconds: the SDK's timeout (1 s), at worst one request per second, and replies that are
// limited after a flood.
TEST(NativeNetwork, ShowsWholeFramesOnceInOrderAndRecoversSoon) {
  const std::uint32_t many = seeds();
  std::int64_t shown = 0;
  for (std::uint32_t seed = 1; seed <= many; ++seed) {
    NativeNetwork network(seed);
    network.suffer();
    shown += network.frames();
    network.heal();
    const Duration served = network.wait_for_frames(20, 5s);
    ASSERT_LT(served, 3s + 20 * kStepsPerFrame * kStep) << "seed " << seed;
    ASSERT_LE(network.clients(), 16u) << "seed " << seed << ": one address";
    ASSERT_FALSE(testing::Test::HasFailure()) << "seed " << seed;
  }
  EXPECT_GT(shown, 10 * many) << "the network was too bad to test anything";
}

}  // namespace
}  // namespace fiducap::native
