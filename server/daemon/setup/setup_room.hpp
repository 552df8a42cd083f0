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
#include <vector>

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "daemon/bodies/body_inbox.hpp"
#include "daemon/bodies/body_reader.hpp"
#include "daemon/setup/setup_guide.hpp"
#include "daemon/setup/simulated_rig.hpp"
#include "middleware/participant.hpp"
#include "streaming/setup_desk.hpp"

namespace fiducap {

/// What a set-up needs from outside.
struct SetupSurroundings {
  std::string file;        ///< The configuration that is to be made.
  bool offers_simulation;  ///< A simulated robot stands beside the cameras of this machine.
  const Clock& clock;
  std::function<Expected<std::shared_ptr<dds::Participant>>()> join_dds;
  std::function<void()> written;  ///< The configuration is there; called once.
};

/// A set-up that goes on: its sensors, their readers, and the thread that guides. Between the pages
/// and the guide are a queue of commands and the newest state.
class SetupRoom final : public SetupDesk, private SetupRig {
 public:
  explicit SetupRoom(SetupSurroundings surroundings);
  ~SetupRoom() override;

  /// A thread of its own.
  void run(std::stop_token stop);
  /// Shown to the person in front of the terminal only: who knows it leads the set-up.
  [[nodiscard]] const std::string& secret() const { return secret_; }

  [[nodiscard]] bool admits(std::string_view secret) const override;
  [[nodiscard]] std::shared_ptr<const std::string> state() const override;
  [[nodiscard]] std::shared_ptr<const std::string> picture() override;
  Expected<void> command(std::string what, std::map<std::string, std::string> values) override;
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
  void let_go_of_imu() override { imu_.reset(); }
  void begin(SetupStep step) override;
  [[nodiscard]] std::optional<simulation::SimulatedBodyConfig> simulated() const override;

  [[nodiscard]] std::unique_ptr<Sensor> read(std::unique_ptr<SensorSource> source,
                                             const char* name);
  void obey();
  void obey(const SetupCommand& command);
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
  std::string error_;  ///< Of the last command; empty: it was done.
  bool is_written_{false};
  Instant shown_at_{};
  GrayImage scaled_;
  std::vector<float> sums_;
  std::vector<std::uint8_t> jpeg_;
  std::atomic<std::int64_t> picture_asked_ns_{0};

  mutable std::mutex mutex_;  ///< Of what follows.
  std::vector<SetupCommand> commands_;
  std::shared_ptr<const std::string> state_;
  std::shared_ptr<const std::string> picture_;
};

/// As the page gets it.
[[nodiscard]] std::string setup_json(const SetupGuide& guide, const std::string& file,
                                     const std::string& error, bool is_written);

}  // namespace fiducap
