#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"

namespace fiducap::vrpn {

/// All reports of one frame, the same for every client but for the sequence numbers (still 0).
struct EncodedFrame {
  std::vector<std::byte> bytes;
  std::vector<std::size_t>
      datagram_ends;  ///< Where to cut `bytes` for UDP: whole messages, at most 1472 bytes each.
  /// When all datagrams but the last have this one length; 0: they differ.
  [[nodiscard]] std::size_t equal_cut() const;
};

struct ReportContent {
  bool velocity{true};
  bool acceleration{false};
};

/// Turns frames into reports: pose, and velocity and acceleration when asked for, of every valid
/// body: sensor 0 is its pivot, more sensors move with it (velocity and centripetal acceleration of
/// their own points).
///
/// Every report of a frame carries the UTC of `frame.at`. An invalid body is not reported: VRPN has
/// no validity flag. The angular rate travels as the turn that happens in dt = 1 s, or less when
/// the body turns by more than 0.9 pi per second (vrpn_client_ros ignores dt and is right only for
/// 1 s). Acceleration is that of the pivot in world axes, at rest 0; angular acceleration is not
/// estimated (identity, 1 s).
class ReportEncoder final {
 public:
  ReportEncoder(const OutputAxes& axes, ReportContent content) : axes_(axes), content_(content) {}

  /// @param sender_of_body  in the order of frame.bodies; negative: not served.
  /// @param sensors_of_body  X_PS of sensors 1, 2, … in the order of frame.bodies; may be shorter
  /// @param out  overwritten; its memory is reused, nothing is allocated after warm-up.
  void encode(const SceneFrame& frame, std::span<const std::int32_t> sender_of_body,
              std::span<const std::vector<Pose>> sensors_of_body, EncodedFrame& out) const;

 private:
  struct Stamp {
    std::int64_t utc_ns;
    std::int32_t sender;
    int sensor;
  };
  /// @param X_PS  where the sensor sits on the body
  void append(const BodyPose& body, const Pose& X_PS, const Stamp& stamp,
              std::vector<std::byte>& out) const;

  AxesChange axes_;
  ReportContent content_;
};

}  // namespace fiducap::vrpn
