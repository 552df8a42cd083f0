#pragma once

#include <gtest/gtest.h>

#include "messages.hpp"
#include "streaming/natnet/conversation.hpp"
#include "support/fake_operator_api.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::natnet {

/// A server with two bodies and a clock that the test moves.
class ConversationFixture : public testing::Test {
 protected:
  static constexpr Peer kClient{0x0a000007, 40001};
  static constexpr Peer kOther{0x0a000008, 40002};

  void start() {
    // As the server: with named clients only its own addresses.
    const auto attached = [own_only = !config_.clients.empty()] {
      std::vector all{*net::parse_network("127.0.0.0/8")};
      if (!own_only) all.push_back(*net::parse_network("10.0.0.0/8"));
      return all;
    };
    conversation_.emplace(config_, make_scene_frame({"arm", "drone"})->model, &operator_api_, 100,
                          12345, net::TrustedNetworks(config_.trusted_networks(), attached), now_);
  }
  void SetUp() override {
    config_.remote_control = RemoteControl::kLoopback;
    start();
  }

  std::span<const std::byte> say(const Bytes& datagram, const Peer& from = kClient,
                                 Channel channel = Channel::kUnicast) {
    return conversation_->receive(datagram, from, channel, now_);
  }
  std::span<const std::byte> say_to_group(const Bytes& datagram) {
    return say(datagram, kClient, Channel::kMulticast);
  }
  void pass(double seconds) {
    now_ += from_seconds(seconds);
    conversation_->expire(now_);
  }
  /// The next frame. @param generation  of its model
  void next_frame(std::uint64_t generation = 1,
                  const std::vector<std::string>& names = {"arm", "drone"}) {
    auto frame = make_scene_frame(names, ++number_);
    frame->model = std::make_shared<SceneModel>(SceneModel{generation, frame->model->bodies});
    frame->at = frame->published_at = now_;
    conversation_->take(frame, now_);
  }
  /// @return the frame that this client is sent now; empty: none
  Bytes frame_of(const Peer& peer = kClient) {
    for (const auto& one : conversation_->subscribers()) {
      if (one.peer != peer) continue;
      const auto bytes = conversation_->frame_for(one, now_);
      return {bytes.begin(), bytes.end()};
    }
    return {};
  }
  void join(const Bytes& connect, const Peer& peer = kClient) {
    (void)say(connect, peer);
    (void)say(message(Message::kKeepAlive), peer);
  }
  [[nodiscard]] std::size_t clients() const { return conversation_->subscribers().size(); }

  NatNetConfig config_;
  FakeOperatorApi operator_api_;
  Instant now_ = instant_from_ns(1'000'000'000'000);
  std::uint64_t number_{0};
  std::optional<Conversation> conversation_;
};

}  // namespace fiducap::natnet
