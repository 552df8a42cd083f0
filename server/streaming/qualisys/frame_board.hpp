#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/handover.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/qualisys/protocol.hpp"
#include "streaming/qualisys/qualisys.hpp"

namespace fiducap::qualisys {

/// The index of each body in data packets, for the life of the server.
///
/// The protocol identifies bodies by index, and many clients read the list once. So a body keeps
/// its index: a disabled one stays as NaN, a new one is appended.
class BodyTable final {
 public:
  struct Entry {
    int id{};
    std::string name;  ///< For clients.
    bool enabled{true};
  };

  BodyTable() = default;
  explicit BodyTable(NameAliases aliases) : aliases_(std::move(aliases)) {}

  /// @return false when the generation is unchanged
  bool update(const SceneModel& model);

  [[nodiscard]] std::span<const Entry> entries() const { return entries_; }
  /// Index of the i-th body of the model.
  [[nodiscard]] std::span<const std::size_t> index_of_body() const { return index_of_body_; }

 private:
  NameAliases aliases_;
  std::optional<std::uint64_t> generation_;
  std::vector<Entry> entries_;
  std::vector<std::size_t> index_of_body_;
};

/// Clients with equal profiles get equal data packets.
struct Profile {
  Components components;
  std::endian order{std::endian::little};
  bool wide{false};  ///< Doubles: protocol below 1.8.
  friend bool operator==(const Profile&, const Profile&) = default;
};

/// One frame for all clients of one profile.
struct EncodedFrame {
  std::vector<std::byte> packet;  ///< For TCP.
  /// For UDP: `packet`, or `split` when it is too long for a datagram.
  std::vector<std::byte> split;
  std::vector<std::size_t> datagram_ends;
  [[nodiscard]] std::span<const std::byte> datagrams() const {
    return split.empty() ? std::span(packet) : std::span(split);
  }
};

/// Encodes frames as data packets: u64 time µs (server's clock, time of the poses), u32 frame
/// number, u32 count, then the components: u32 size, u32 type, u32 bodies, 2 × u16 0 and per body x
/// y z in mm, R by columns (6D) or three angles in degrees (6DEuler), and the residual (…Res).
///
/// Every body of the table is in every frame, in its order; an invalid one as NaN (all bits set).
/// The residual is the 1-sigma of the position in mm. Timecode is `camera time`, 10 MHz: UTC since
/// 1970. Components without data are sent empty.
class FrameEncoder final {
 public:
  /// @param when_invalid  kHold: the last valid pose instead of NaN; else NaN
  FrameEncoder(const OutputAxes& axes, WhenInvalid when_invalid)
      : axes_(axes), hold_(when_invalid == WhenInvalid::kHold) {}

  /// Takes a frame and computes what all profiles share.
  /// @param rows  bodies per data packet; never fewer than in the last call
  /// @param row_of_body  row of each body of the frame
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

/// The newest frame, encoded at most once per profile, when requested.
class FrameBoard final {
 public:
  explicit FrameBoard(const QualisysConfig& config)
      : encoder_(config.axes(), config.when_invalid),
        hold_(config.when_invalid == WhenInvalid::kHold) {}

  /// @param bodies  updated with the frame's model; outlives this
  void put(const std::shared_ptr<const SceneFrame>& frame, const BodyTable& bodies);
  /// Number of the newest frame; 0: none.
  [[nodiscard]] std::uint64_t number() const { return number_; }
  /// @pre number() != 0. Allocates nothing after warm-up.
  [[nodiscard]] std::shared_ptr<const EncodedFrame> encoded(const Profile& profile);

 private:
  void begin();

  struct Kept {
    Profile profile;
    std::shared_ptr<const EncodedFrame> frame;
  };
  FrameEncoder encoder_;
  bool hold_;
  std::uint64_t number_{0};
  std::shared_ptr<const SceneFrame> frame_;  ///< Until it is encoded or replaced.
  const BodyTable* bodies_{nullptr};
  std::vector<Kept> kept_;
  ObjectPool<EncodedFrame> pool_;
};

}  // namespace fiducap::qualisys
