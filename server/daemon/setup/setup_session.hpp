#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "base/event_board.hpp"
#include "daemon/access_keeper.hpp"
#include "daemon/bodies/body_reader.hpp"
#include "daemon/setup/setup_guide.hpp"
#include "daemon/setup/setup_rig.hpp"
#include "middleware/participant.hpp"
#include "streaming/page_api.hpp"

namespace fiducap {

/// What a set-up needs.
struct SetupSurroundings {
  std::string file;        ///< The configuration to be written.
  bool offers_simulation;  ///< Also offers a simulated robot.
  const Clock& clock;
  std::function<Expected<std::shared_ptr<dds::Participant>>()> join_dds;
  std::function<void()> written;  ///< The configuration was written; called once.
  AccessKeeper& access;
};

/// A set-up in progress: its sensors, their readers, and the guide's thread. A queue of commands
/// and the newest state connect the pages with the guide.
class SetupSession final : public SetupApi, private SetupRig {
 public:
  explicit SetupSession(SetupSurroundings surroundings);
  ~SetupSession() override;

  /// A thread of its own.
  void run(std::stop_token stop);
  /// Shown on the terminal only; proves the user of the set-up.
  [[nodiscard]] const std::string& secret() const { return secret_; }

  [[nodiscard]] bool admits(std::string_view secret) const override;
  [[nodiscard]] std::shared_ptr<const std::string> state() const override;
  [[nodiscard]] std::shared_ptr<const std::string> picture() override;
  Expected<void> command(Requester by, std::string what,
                         std::map<std::string, std::string> values) override;
  void note_refusal(const Requester& by) override;
  [[nodiscard]] Expected<std::string> sheet(
      std::map<std::string, std::string> order) const override;

 private:
  struct Sensor {
    std::unique_ptr<BodyReader> reader;
    std::jthread thread;
  };

  [[nodiscard]] std::vector<FoundCamera> cameras() override;
  Expected<void> use(const CameraDeviceConfig& camera) override;
  Expected<void> use(const ImuSourceConfig& imu) override;
  void close_imu() override { imu_.reset(); }
  void begin(SetupStep step) override;
  [[nodiscard]] std::optional<simulation::SimulatedBodyConfig> simulated() const override;

  [[nodiscard]] std::unique_ptr<Sensor> read(std::unique_ptr<SensorSource> source,
                                             const char* name);
  void carry_out_commands();
  Expected<void> write(const SetupCommand& command);
  [[nodiscard]] std::string lost_sensor() const;
  void show();
  void make_picture();

  SetupSurroundings surroundings_;
  const std::string secret_;
  EventBoard events_;
  BodyInbox inbox_;
  std::vector<Delivery> taken_;
  std::unique_ptr<SimulatedRig> simulation_;  ///< While its camera is in use.
  std::unique_ptr<Sensor> camera_;
  std::unique_ptr<Sensor> imu_;
  SetupGuide guide_;
  std::string error_;  ///< Of the last command; empty: none.
  bool is_written_{false};
  Instant shown_at_{};
  GrayImage scaled_;
  std::vector<float> sums_;
  std::vector<std::uint8_t> jpeg_;
  std::atomic<std::int64_t> picture_asked_ns_{0};

  mutable std::mutex mutex_;  ///< Of the members below.
  std::vector<std::pair<Requester, SetupCommand>> commands_;
  std::shared_ptr<const std::string> state_;
  std::shared_ptr<const std::string> picture_;
};

}  // namespace fiducap
