#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "fiducap/v1/control.pb.h"
#include "proof/control_proof.hpp"

namespace fiducap {

/// A message of the control channel after its length in four bytes, lowest first.
inline std::string control_frame(const std::string& message) {
  std::string length;
  for (int i = 0; i < 4; ++i) length += static_cast<char>(message.size() >> (8 * i));
  return length + message;
}

/// The reply after its length.
inline v1::ControlReply control_reply(std::string_view message) {
  v1::ControlReply reply;
  EXPECT_TRUE(message.size() > 4 &&
              reply.ParseFromArray(message.data() + 4, static_cast<int>(message.size()) - 4));
  return reply;
}

/// A request with the proof that its sender knows the token. @param body  a serialized command
inline std::string control_request(const std::string& token, const std::string& challenge,
                                   const std::string& body, std::uint64_t sequence = 1) {
  v1::ControlRequest request;
  request.set_sequence(sequence);
  const auto proof = proof::control_proof(token, challenge, sequence, body);
  request.set_proof(std::string(proof.begin(), proof.end()));
  request.set_body(body);
  return control_frame(request.SerializeAsString());
}

}  // namespace fiducap
