#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "src/messages.hpp"

namespace fiducap::sdk {

enum class MessageKind {
  kNone,
  kChallenge,
  kLease,
  kModel,
  kFrame,
  kNotice,
  kClockReply,
  kDiscoveryReply
};

/// Decodes datagrams of a server. Keeps its memory: no allocation for frames after warm-up.
class Decoder {
 public:
  Decoder();
  ~Decoder();

  /// @return the kind of message, readable below until the next call; kNone for an invalid one:
  /// wrong
  ///         protocol, cut off, parts outside their list, a valid body without a finite pose
  MessageKind decode(const std::uint8_t* bytes, std::size_t size);

  const Challenge& challenge() const { return challenge_; }
  const Lease& lease() const { return lease_; }
  const Notice& notice() const { return notice_; }
  const ModelPart& model() const { return model_; }
  const FramePart& frame() const { return frame_; }
  const ClockReply& clock_reply() const { return clock_reply_; }
  const DiscoveryReply& discovery_reply() const { return discovery_reply_; }

 private:
  class Scratch;  // protobuf stays in the source file
  MessageKind read(const Scratch& scratch);

  std::unique_ptr<Scratch> scratch_;
  Challenge challenge_;
  Lease lease_;
  Notice notice_;
  ModelPart model_;
  FramePart frame_;
  ClockReply clock_reply_;
  DiscoveryReply discovery_reply_;
};

/// Padded to kMinSubscribe.
std::vector<std::uint8_t> encode(const SubscribeRequest& request);
std::vector<std::uint8_t> encode_unsubscribe(std::uint64_t token);
/// Allocates nothing: it is sent ten times a second.
std::array<std::uint8_t, 64> encode_clock_query(std::uint64_t token, std::uint64_t number);
std::vector<std::uint8_t> encode_discovery_query(std::uint64_t nonce);

}  // namespace fiducap::sdk
