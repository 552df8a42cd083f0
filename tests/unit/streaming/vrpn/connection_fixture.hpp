#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "base/bytes.hpp"
#include "streaming/vrpn/session.hpp"
#include "support/hex.hpp"

namespace fiducap::vrpn {

using Bytes = std::vector<std::byte>;

/// Bytes of the real library, see tests/golden/vrpn/README.md.
inline Bytes golden(const std::string& name) {
  std::ifstream file(std::string(FIDUCAP_SOURCE_DIR) + "/tests/golden/vrpn/" + name + ".hex");
  EXPECT_TRUE(file) << name;
  std::ostringstream text;
  text << file.rdbuf();
  return from_hex(text.str());
}

inline constexpr std::int64_t kNow_ns = 1'700'000'000'000'000'000;

// The client numbers as no server would, so that an answer with the wrong table cannot pass.
inline constexpr std::int32_t kClientArm = 40;
inline constexpr std::int32_t kClientGhost = 41;
constexpr std::int32_t client_type(Type type) { return 90 - static_cast<std::int32_t>(type); }

inline Header from_client(std::int32_t sender, std::int32_t type) {
  return {kNow_ns, sender, type, 0};
}

inline Bytes& operator+=(Bytes& a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

inline Bytes description(std::int32_t kind, std::int32_t id, std::string_view name) {
  Bytes out;
  encode_description(from_client(id, kind), name, out);
  return out;
}

inline Bytes empty(std::int32_t sender, Type type) {
  Bytes out;
  encode_empty(from_client(sender, client_type(type)), out);
  return out;
}

/// @param length  as announced, which may be wrong
inline Bytes raw_message(std::uint32_t length, std::int32_t sender, std::int32_t type,
                         const Bytes& payload = {}) {
  Bytes out;
  BigEndianWriter(out).u32(length).u32(0).u32(0).i32(sender).i32(type).u32(0).bytes(payload);
  return out;
}

inline Bytes udp_description(std::int32_t port) {
  return raw_message(34, port, kUdpDescription, from_hex("3132372e302e302e31 00 000000000000"));
}

/// Cookie, UDP offer, names and types, as libvrpn sends them.
inline Bytes hello(std::string_view name = "arm") {
  Bytes out = golden("cookie");
  out += udp_description(46815);
  out += description(kSenderDescription, 39, "VRPN Control");
  out += description(kSenderDescription, kClientArm, name);
  for (std::size_t i = 0; i < kTypeNames.size(); ++i) {
    out += description(kTypeDescription, client_type(static_cast<Type>(i)), kTypeNames[i]);
  }
  out += description(kTypeDescription, 5, "vrpn_Button Change");
  return out;
}

struct Sent {
  Header header;
  Bytes payload;
  [[nodiscard]] std::string name() const { return std::string(*decode_name(payload)); }
};

inline std::vector<Sent> split(std::span<const std::byte> bytes) {
  std::vector<Sent> all;
  while (!bytes.empty()) {
    const auto message = decode_message(bytes);
    if (!message) {
      ADD_FAILURE() << message.error().text();
      break;
    }
    all.push_back({message->header, {message->payload.begin(), message->payload.end()}});
    bytes = bytes.subspan(message->size);
  }
  return all;
}

/// A server with the bodies drone and arm, and what a client sends to it.
class VrpnConnectionTest : public testing::Test {
 protected:
  VrpnConnectionTest() { senders_.update(SceneModel{1, {{1, "drone"}, {2, "arm"}}}); }

  Connection make(Origin origin = Origin::kRequested) { return {config_, senders_, origin}; }
  /// A connection that has received the client's hello.
  Connection greeted(Origin origin = Origin::kRequested, std::string_view name = "arm") {
    Connection connection = make(origin);
    feed(connection, hello(name));
    return connection;
  }
  /// Feeds one piece. @return the answers of the server
  std::vector<Sent> feed(Connection& connection, const Bytes& bytes) {
    Bytes out;
    const auto result = connection.receive(bytes, kNow_ns, out);
    EXPECT_TRUE(result) << result.error().text();
    return split(out);
  }
  std::vector<Sent> ping(Connection& connection, std::int32_t sender) {
    return feed(connection, empty(sender, Type::kPing));
  }

  VrpnConfig config_;
  SenderTable senders_;
};

}  // namespace fiducap::vrpn
