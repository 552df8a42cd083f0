#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/handover.hpp"
#include "base/time.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/net/tcp_session.hpp"
#include "streaming/vicon/codec.hpp"
#include "streaming/vicon/protocol.hpp"

namespace fiducap::vicon {

/// Frame numbers by time: number = time · rate, so a missing frame leaves a gap and clients may
/// compute time as number / rate. Strictly ascending; wraps to 0 after 2^31 frames.
class FrameNumbers final {
 public:
  /// @pre rate_hz > 0
  [[nodiscard]] std::uint32_t next(Instant at, double rate_hz);
  /// The evenly spaced time of the last number. @pre `next` was called
  [[nodiscard]] Instant due() const;

 private:
  std::optional<Instant> start_;
  double rate_hz_{0};
  std::int64_t first_{0};
  std::int64_t next_{0};
};

/// One body of one frame for clients.
struct SubjectPose {
  bool listed{true};   ///< In the list of subjects.
  bool visible{true};  ///< Has segments; a listed subject without is occluded.
  double quality{};    ///< 0 bad … 1 excellent.
  SegmentPose segment;
};

/// Quality on Vicon's scale: 1 / (1 + (worst sigma / 20 mm or 20 mrad)²), 0 for an invalid pose.
[[nodiscard]] double quality_of(const BodyPose& body);

/// A frame's bodies in millimetres. Invalid ones by policy: flag – occluded; stop – not listed;
/// hold – the last valid pose at quality 0.
class SubjectPoses final {
 public:
  SubjectPoses(const OutputAxes& axes, WhenInvalid when_invalid)
      : axes_(axes), when_invalid_(when_invalid) {}

  /// Fills `all`, in the order of the frame's bodies. Allocates nothing after warm-up.
  void update(const SceneFrame& frame);
  [[nodiscard]] const std::vector<SubjectPose>& all() const { return all_; }

 private:
  void show(const BodyPose& body, SubjectPose& out);

  AxesChange axes_;
  WhenInvalid when_invalid_;
  std::vector<SubjectPose> all_;
  std::uint64_t axes_number_{0};  ///< Of the last frame; held poses are dropped when it changes.
  std::unordered_map<int, SegmentPose> held_;  ///< By body; only for hold.
};

/// Encoded objects of one type, from which any selection of subjects can be copied.
struct ObjectRun {
  struct End {
    std::uint32_t subject{};  ///< 0: none.
    std::size_t at{};         ///< After its last byte.
  };
  std::vector<std::byte> bytes;
  std::vector<End> ends;

  void clear() {
    bytes.clear();
    ends.clear();
  }
  /// The bytes appended since the last call are one object.
  void finish(std::uint32_t subject = 0) { ends.push_back({subject, bytes.size()}); }

  /// @param wanted  ascending; null: all of them
  [[nodiscard]] static bool admits(const std::vector<std::uint32_t>* wanted,
                                   std::uint32_t subject) {
    return wanted == nullptr || std::binary_search(wanted->begin(), wanted->end(), subject);
  }
  [[nodiscard]] std::uint32_t count(const std::vector<std::uint32_t>* wanted) const {
    return static_cast<std::uint32_t>(
        std::ranges::count_if(ends, [&](const End& end) { return admits(wanted, end.subject); }));
  }
  void append_to(std::vector<std::byte>& out, const std::vector<std::uint32_t>* wanted) const {
    if (wanted == nullptr) {
      out.insert(out.end(), bytes.begin(), bytes.end());
      return;
    }
    std::size_t begin = 0;
    for (const End& end : ends) {
      if (admits(wanted, end.subject))
        out.insert(out.end(), bytes.begin() + static_cast<std::ptrdiff_t>(begin),
                   bytes.begin() + static_cast<std::ptrdiff_t>(end.at));
      begin = end.at;
    }
  }
};

/// The newest frame and its encoded packets.
///
/// Each object is encoded at most once per frame, when a profile has its type; each packet is
/// composed once per profile and shared by its clients. The static objects (names, rate, …) are
/// encoded again when they change, with a new version. Allocates nothing after warm-up.
class FrameBoard final {
 public:
  explicit FrameBoard(WhenInvalid when_invalid, NameAliases aliases = {});

  /// @param now  when it is offered to the clients
  void update(const SceneFrame& frame, Instant now);
  [[nodiscard]] bool empty() const { return statics_version_ == 0; }
  /// Of the newest frame. @pre not empty
  [[nodiscard]] std::uint32_t id() const { return id_; }
  /// Increases when the list of subjects, a name or the rate changes.
  [[nodiscard]] std::uint64_t statics_version() const { return statics_version_; }

  /// The newest frame as one packet; its latency includes the delay until a client asked for it.
  /// @param statics  with the static objects; else they are marked as unchanged
  [[nodiscard]] net::SharedBytes packet(const std::shared_ptr<const Profile>& profile, bool statics,
                                        Instant now);

 private:
  struct Ready {
    std::shared_ptr<const Profile> profile;
    bool statics{};
    net::SharedBytes bytes;
  };
  struct Subject {
    std::uint32_t id{};
    std::string name;

    friend bool operator==(const Subject&, const Subject&) = default;
  };

  void refresh_statics(const SceneFrame& frame);
  const ObjectRun& run_of(Type type);
  void encode(Type type, ObjectRun& run) const;
  void encode_once(Type type, std::vector<std::byte>& out) const;
  void encode_per_subject(Type type, ObjectRun& run) const;
  void compose(const Profile& profile, bool statics, Duration waited, std::vector<std::byte>& out);
  void append_contents(const Profile& profile, bool statics, std::vector<std::byte>& out);

  SubjectPoses poses_;
  NameAliases aliases_;
  FrameNumbers numbers_;
  std::uint32_t id_{0};
  std::uint32_t hardware_number_{0};
  Timecode timecode_;
  double rate_hz_{0};
  double camera_hz_{0};
  Duration made_{};     ///< Instant of the poses → the frame was made.
  Duration offered_{};  ///< Made → updated.
  Instant updated_at_{};

  std::uint64_t statics_version_{0};
  std::uint64_t generation_{0};
  std::vector<bool> listed_;
  std::vector<Subject> subjects_;

  std::array<ObjectRun, kOffered.size()> runs_;  ///< As kOffered.
  std::array<bool, kOffered.size()> encoded_{};  ///< For this frame; static ones until changed.
  ObjectPool<std::vector<std::byte>> packets_;
  std::vector<Ready> ready_;
};

}  // namespace fiducap::vicon
