#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/natnet/codec.hpp"
#include "streaming/natnet/registry.hpp"

namespace fiducap::natnet {

/// Frame params, one bit each.
struct FrameBits {
  static constexpr std::int16_t kRecording = 1 << 0;
  static constexpr std::int16_t kModelChanged = 1 << 1;
  static constexpr std::int16_t kBitstreamChanged = 1 << 3;
};

/// Clients with equal profiles get equal bytes.
struct FrameProfile {
  FrameLayout layout{FrameLayout::k3_0};
  bool bitstream_changed{};
  const Selection* selection{};  ///< nullptr: all bodies.
};

/// Encodes frames as FRAMEOFDATA, once per distinct profile.
///
/// `load`, then `encode` for every profile with clients. Poses are converted to the clients' axes
/// once per frame. Keeps its memory: after warm-up nothing is allocated.
class FrameEncoder final {
 public:
  /// @param epoch  of the frames' time stamps in seconds; recent, because 2.6 sends a float
  FrameEncoder(const OutputAxes& axes, WhenInvalid when_invalid, Instant epoch);

  /// @param sent_at  the transmit stamp; not before the frame was published
  /// @param bits  recording, model changed
  void load(const SceneFrame& frame, Instant sent_at, std::int16_t bits);
  /// @pre load
  /// @return one datagram, valid until the next `load`
  [[nodiscard]] std::span<const std::byte> encode(const FrameProfile& profile);

 private:
  static constexpr std::size_t kLayouts = 6;
  struct Encoded {
    std::vector<std::byte> bytes;
    bool fresh{};
    Selection selection;
    FrameLayout layout{};
    bool bitstream_changed{};
  };
  /// The last valid pose of a body.
  struct LastValid {
    int id{};
    bool known{};
    Pose X_WP;
    float mean_error{};
  };
  struct Stamps {
    double seconds{};
    float latency_s{};
    std::int64_t mid_exposure{};
    std::int64_t data_received{};
    std::int64_t transmit{};
  };
  struct Record {
    int id{};
    bool valid{};
    std::size_t at{};  ///< Its bytes in record_bytes_.
  };

  void load_body(std::size_t index, const BodyPose& body);
  void write_record(int id, const Pose& X_CP, float mean_error, bool valid);
  [[nodiscard]] Encoded& place_for(const FrameProfile& profile);
  void write(const FrameProfile& profile, std::vector<std::byte>& bytes) const;
  void write_bodies(const FrameProfile& profile, std::vector<std::byte>& bytes) const;
  void write_suffix(const FrameProfile& profile, std::vector<std::byte>& bytes) const;

  AxesChange change_;
  WhenInvalid when_invalid_;
  Instant epoch_;
  std::int32_t number_{};
  Stamps stamps_;
  std::int16_t bits_{};
  std::uint64_t axes_number_{0};  ///< Of the last frame; last_valid_ is dropped when it changes.
  std::vector<LastValid> last_valid_;  ///< In the order of the frame's bodies.
  std::vector<Record> records_;
  std::vector<std::byte> record_bytes_;
  std::array<Encoded, 2 * kLayouts> everything_;  ///< By layout, bitstream changed or not.
  std::deque<Encoded> selections_;                ///< With some bodies; grows to the most at once.
};

}  // namespace fiducap::natnet
