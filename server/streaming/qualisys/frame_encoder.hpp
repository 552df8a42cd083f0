#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/validity.hpp"
#include "streaming/qualisys/protocol.hpp"

namespace fiducap::qualisys {

/// What makes two clients' data packets equal.
struct Profile {
  Components components;
  std::endian order{std::endian::little};
  bool wide{false};  ///< Doubles: protocol below 1.8.
  friend bool operator==(const Profile&, const Profile&) = default;
};

/// One frame for all clients of one profile.
struct EncodedFrame {
  std::vector<std::byte> packet;  ///< As TCP clients get it.
  /// The same for UDP: `packet`, or `split` when that is too long for a datagram.
  std::vector<std::byte> split;
  std::vector<std::size_t> datagram_ends;
  [[nodiscard]] std::span<const std::byte> datagrams() const {
    return split.empty() ? std::span(packet) : std::span(split);
  }
};

/// Turns frames into data packets: u64 time µs (the server's clock, of the instant the poses are
/// for), u32 frame number, u32 count, then the components: u32 size, u32 type, u32 bodies, 2 × u16
/// 0 and per body x y z in mm, then R by columns (6D) or three angles in degrees (6DEuler), then
/// the residual (…Res).
///
/// Every body of the table is in every frame, in its order. One that may not be used has all bits
/// of all its numbers set: NaN. The residual is the 1-sigma of the position in mm: there are no
/// markers whose residual could be meant. Timecode is `camera time`, 10 MHz: UTC since 1970.
/// Components that we have nothing for are sent empty.
class FrameEncoder final {
 public:
  /// @param when_invalid  kHold: the last valid pose instead of NaN; the others are NaN
  FrameEncoder(const OutputAxes& axes, WhenInvalid when_invalid)
      : axes_(axes), hold_(when_invalid == WhenInvalid::kHold) {}

  /// Takes a frame; what is common to all profiles is computed once.
  /// @param rows  how many bodies a data packet has; never fewer than in the last call
  /// @param row_of_body  where each body of the frame is among them
  void begin(const SceneFrame& frame, std::size_t rows, std::span<const std::size_t> row_of_body);
  /// @pre begin was called
  /// @param out  overwritten; nothing is allocated after warm-up
  void encode(const Profile& profile, EncodedFrame& out) const;

 private:
  struct Row {
    bool valid{false};
    Eigen::Vector3d p_mm;
    Eigen::Matrix3d R;
    Eigen::Vector3d euler_deg;
    double sigma_mm{0};
  };
  template <class Writer>
  std::size_t begin_packet(std::vector<std::byte>& bytes) const;
  template <class Writer>
  void encode_as(const Profile& profile, EncodedFrame& out) const;
  template <class Writer>
  void split_as(const Profile& profile, EncodedFrame& out) const;
  template <class Writer>
  void write_component(Component component, bool wide, std::vector<std::byte>& out) const;
  template <class Writer>
  void write_bodies(Component component, bool wide, Writer& writer) const;

  AxesChange axes_;
  bool hold_;
  std::uint64_t time_us_{0};
  std::uint64_t utc_100ns_{0};
  std::uint32_t number_{0};
  std::uint64_t axes_number_{0};
  std::vector<Row> rows_;
};

/// QTM's standard angles (roll, pitch, yaw), degrees: R = Rx(a1) · Ry(a2) · Rz(a3), a2 within ±90.
/// At a2 = ±90 only one of a1 ± a3 is defined; a3 is 0 then.
/// @pre R is a rotation
[[nodiscard]] Eigen::Vector3d euler_deg(const Eigen::Matrix3d& R);

}  // namespace fiducap::qualisys
