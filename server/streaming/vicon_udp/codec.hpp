#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "middleware/net/peer.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/protocol_conventions.hpp"

namespace fiducap::vicon_udp {

/// Bytes of a datagram; receivers expect one of these.
inline constexpr std::array kBlockSizes{256, 512, 1024};
/// Header of a datagram: u32 frame number, u8 items. All numbers are little-endian.
inline constexpr std::size_t kHeaderBytes = 5;
/// Name of an object with its NUL.
inline constexpr std::size_t kNameBytes = 24;
/// An item: u8 kind (0: object), u16 size of the rest (72), char name[24], f64 x y z in mm, f64
/// angles about x, y, z in rad (R = Rx Ry Rz).
inline constexpr std::size_t kItemBytes = 75;

/// `ip:port`, also of a broadcast. @return nullopt: another text, or a multicast group
[[nodiscard]] std::optional<net::Peer> receiver_in(const std::string& text);

/// Frames as datagrams of one size; zeros after the last item. Keeps its memory: allocates nothing
/// after the first frame of a model.
class BlockEncoder final {
 public:
  /// @param block_bytes  of kBlockSizes   @param when_invalid  kStop or kHold
  BlockEncoder(std::size_t block_bytes, WhenInvalid when_invalid, NameAliases aliases);

  /// @return whole datagrams, `block_bytes` each, live until the next call; empty: no valid body
  [[nodiscard]] std::span<const std::byte> encode(const SceneFrame& frame);

 private:
  void use(const SceneModel& model);
  /// @return nullptr: the body is absent
  [[nodiscard]] const Pose* shown(const BodyPose& body);

  std::size_t block_bytes_;
  WhenInvalid when_invalid_;
  NameAliases aliases_;
  AxesChange axes_;
  std::uint64_t axes_number_{0};
  std::uint64_t generation_{0};
  std::vector<std::string> names_;  ///< Empty: no model yet.
  std::map<int, Pose> held_;        ///< By body id; with kHold only.
  Pose pose_{};
  std::vector<std::byte> bytes_;
};

}  // namespace fiducap::vicon_udp
