#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/object_pool.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/net/tcp_outbox.hpp"
#include "streaming/vicon/frame_numbers.hpp"
#include "streaming/vicon/object_run.hpp"
#include "streaming/vicon/profile.hpp"
#include "streaming/vicon/subject_poses.hpp"

namespace fiducap::vicon {

/// The newest frame, and its bytes for whoever asks.
///
/// Each object is encoded once per frame and only when somebody wants its type; each packet is put
/// together once per profile and shared by all clients with that profile. The static objects
/// (names, rate, …) are encoded when they change, which is their version. Allocates nothing after
/// warm-up.
class FrameBoard final {
 public:
  explicit FrameBoard(WhenInvalid when_invalid, NameAliases aliases = {});

  /// Replaces what was there. @param now  when it is offered to the clients
  void put_up(const SceneFrame& frame, Instant now);
  [[nodiscard]] bool empty() const { return statics_version_ == 0; }
  /// Of the newest frame. @pre not empty
  [[nodiscard]] std::uint32_t id() const { return id_; }
  /// Counts up when the list of subjects, a name or the rate changes.
  [[nodiscard]] std::uint64_t statics_version() const { return statics_version_; }

  /// The newest frame as one packet. One that leaves late (a client asked after it was put up) says
  /// so in its latency.
  /// @param statics  with the static objects; without them the client is told to keep what it has
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
  void list_subjects(const SceneFrame& frame);
  void encode_statics();
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
  Duration offered_{};  ///< Made → put up.
  Instant put_up_at_{};

  std::uint64_t statics_version_{0};
  std::uint64_t generation_{0};
  std::vector<bool> listed_;
  std::vector<Subject> subjects_;

  std::array<ObjectRun, kOffered.size()> runs_;  ///< As kOffered.
  std::array<bool, kOffered.size()> encoded_{};  ///< For this frame; static ones for good.
  ObjectPool<std::vector<std::byte>> packets_;
  std::vector<Ready> ready_;
};

}  // namespace fiducap::vicon
