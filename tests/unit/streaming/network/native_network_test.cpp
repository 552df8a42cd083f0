// The server's registry and encoder and the SDK's conversation and assembler over a network that
// loses, doubles, delays and cuts, in virtual time.
#include <gtest/gtest.h>

#include <memory>
#include <set>

#include "src/codec.hpp"
#include "src/conversation.hpp"
#include "src/frame_assembler.hpp"
#include "streaming/native/codec.hpp"
#include "streaming/native/frames.hpp"
#include "streaming/native/registry.hpp"
#include "support/faulty_link.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::native {
namespace {

using namespace std::chrono_literals;

constexpr Duration kStep = 5ms;
constexpr int kStepsPerFrame = 4;
const std::vector<std::string> kNames{"a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l"};

/// One run of a server: registry and the frames it sends.
class ServerRun {
 public:
  ServerRun(std::uint64_t session, std::mt19937& random)
      : registry_(RegistryLimits{}, {random(), random()}, session),
        encoder_(session),
        model_(encode_model(session, *frame_->model)) {}

  void receive(std::span<const std::byte> datagram, const Peer& from, Instant now,
               FaultyLink& down) {
    const auto reply = registry_.receive(datagram, from, frame_->model->generation, now);
    if (!reply.datagram.empty()) down.send(reply.datagram, now);
    if (!reply.send_model) return;
    for (const auto& part : model_) down.send(part, now);
  }
  /// To the client at `peer`; datagrams for ports that it has left go nowhere.
  void publish(std::uint64_t number, Instant now, const Peer& peer, FaultyLink& down) {
    (void)registry_.expire(now);
    frame_->number = number;
    frame_->at = frame_->published_at = now;
    for (const auto& one : registry_.subscribers()) {
      if (one.peer != peer) continue;
      for (const auto& datagram : encoder_.encode(*frame_)) down.send(datagram, now);
    }
  }
  [[nodiscard]] std::size_t clients() const { return registry_.subscribers().size(); }

 private:
  std::shared_ptr<SceneFrame> frame_ = make_scene_frame(kNames);
  Registry registry_;
  FrameEncoder encoder_;
  std::vector<Datagram> model_;
};

/// The SDK without its socket and thread.
class SdkClient {
 public:
  explicit SdkClient(std::mt19937& random)
      : conversation_(500 * sdk::kMillisecond, random(), "network test") {}

  void start(Instant now) { conversation_.start(ns_of(now)); }
  void ask(Instant now, FaultyLink& up) {
    conversation_.tick(ns_of(now));
    if (!conversation_.due(ns_of(now))) return;
    const bool same_run = conversation_.session() == session_;
    const auto question =
        conversation_.question(same_run ? assembler_.model_generation() : 0, ns_of(now));
    const auto bytes = sdk::encode(question);
    up.send(std::as_bytes(std::span(bytes)), now);
  }
  /// @return the frame that it finished
  const Frame* take(std::span<const std::byte> datagram, Instant now) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(datagram.data());
    switch (decoder_.decode(bytes, datagram.size())) {
      case sdk::MessageKind::kChallenge:
        conversation_.on(decoder_.challenge(), ns_of(now));
        return nullptr;
      case sdk::MessageKind::kNotice:
        conversation_.on(decoder_.notice(), ns_of(now));
        return nullptr;
      case sdk::MessageKind::kLease:
        if (!conversation_.on(decoder_.lease(), ns_of(now))) return nullptr;
        if (conversation_.session() != session_) assembler_.begin(conversation_.session());
        session_ = conversation_.session();
        return nullptr;
      case sdk::MessageKind::kModel:
        if (conversation_.heard(decoder_.model().session, ns_of(now)))
          assembler_.add(decoder_.model());
        return nullptr;
      case sdk::MessageKind::kFrame:
        if (!conversation_.heard(decoder_.frame().session, ns_of(now))) return nullptr;
        return assembler_.add(decoder_.frame());
      default:
        return nullptr;
    }
  }

 private:
  static sdk::Nanoseconds ns_of(Instant at) { return at.time_since_epoch().count(); }

  sdk::Conversation conversation_;
  sdk::Decoder decoder_;
  sdk::FrameAssembler assembler_;
  std::uint64_t session_{0};
};

class NativeNetwork {
 public:
  explicit NativeNetwork(std::uint32_t seed)
      : random_(seed),
        up_(random_, LinkFaults::drawn(random_)),
        down_(random_, LinkFaults::drawn(random_)),
        client_(random_) {
    restart();
    client_.start(now_);
  }

  /// Some seconds on the bad network: the server may restart, the client's port may change.
  void suffer() {
    const int steps = 200 + static_cast<int>(random_() % 400);
    for (int i = 0; i < steps; ++i) {
      if (random_() % 1000 == 0) restart();
      if (random_() % 200 == 0) ++peer_.port;  // an address translator forgot it
      step();
    }
  }
  void heal() {
    up_.set({});
    down_.set({});
  }
  /// @return virtual time until the next whole frame, at most `timeout`
  Duration wait_for_frames(int wanted, Duration timeout) {
    const Instant begin = now_;
    const int before = shown_;
    while (shown_ < before + wanted && now_ - begin < timeout) step();
    return now_ - begin;
  }
  [[nodiscard]] std::size_t clients() const { return server_->clients(); }
  [[nodiscard]] int shown() const { return shown_; }

 private:
  void restart() {
    server_ = std::make_unique<ServerRun>(++session_, random_);
    number_ = 0;
  }
  void step() {
    now_ += kStep;
    client_.ask(now_, up_);
    while (const auto datagram = up_.receive(now_)) server_->receive(*datagram, peer_, now_, down_);
    if (++steps_ % kStepsPerFrame == 0) server_->publish(++number_, now_, peer_, down_);
    while (const auto datagram = down_.receive(now_)) {
      if (const Frame* frame = client_.take(*datagram, now_)) show(*frame);
    }
  }
  void show(const Frame& frame) {
    ++shown_;
    ASSERT_EQ(frame.bodies.size(), kNames.size()) << "not whole";
    ASSERT_GT(frame.at_server_ns, newest_) << "shown twice, or after a newer one";
    newest_ = frame.at_server_ns;
  }

  std::mt19937 random_;
  FaultyLink up_;
  FaultyLink down_;
  SdkClient client_;
  std::unique_ptr<ServerRun> server_;
  Peer peer_{0x0a000007, 40001};
  Instant now_ = instant_from_ns(1'000'000'000'000);
  std::uint64_t session_{0};
  std::uint64_t number_{0};
  std::uint64_t steps_{0};
  std::int64_t newest_{0};
  int shown_{0};
};

// Three seconds: the SDK's silence (1 s), a question a second at worst, and answers that are
// rationed for a while after a storm.
TEST(NativeNetwork, NoFrameTwiceNoneAfterANewerAndServedSoonWhenTheNetworkIsGoodAgain) {
  const std::uint32_t many = seeds(1000);
  std::int64_t shown = 0;
  for (std::uint32_t seed = 1; seed <= many; ++seed) {
    NativeNetwork network(seed);
    network.suffer();
    shown += network.shown();
    network.heal();
    const Duration served = network.wait_for_frames(20, 5s);
    ASSERT_LT(served, 3s + 20 * kStepsPerFrame * kStep) << "seed " << seed;
    ASSERT_LE(network.clients(), 16u) << "seed " << seed << ": one address, so many places";
    ASSERT_FALSE(testing::Test::HasFailure()) << "seed " << seed;
  }
  EXPECT_GT(shown, 10 * many) << "so bad a network that nothing was tried";
}

}  // namespace
}  // namespace fiducap::native
