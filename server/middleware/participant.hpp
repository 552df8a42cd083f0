#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/expected.hpp"
#include "middleware/crowd.hpp"
#include "middleware/network.hpp"

struct dds_topic_descriptor;

/// Cyclone DDS, as far as fiducap uses it. Its header is seen by participant.cpp and by those who
/// fill its structs.
namespace fiducap::dds {

/// One entity of the middleware; deletes it, and what hangs on it, at the end.
class Entity final {
 public:
  Entity() = default;
  explicit Entity(std::int32_t handle) : handle_(handle) {}
  Entity(Entity&& other) noexcept : handle_(std::exchange(other.handle_, 0)) {}
  Entity& operator=(Entity&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  Entity(const Entity&) = delete;
  Entity& operator=(const Entity&) = delete;
  ~Entity();

  [[nodiscard]] std::int32_t handle() const { return handle_; }
  [[nodiscard]] explicit operator bool() const { return handle_ > 0; }

 private:
  std::int32_t handle_{0};
};

/// What a topic is: its name on the wire and its type.
struct TopicName {
  std::string name;                    ///< As on the wire: `rt/tf`.
  const dds_topic_descriptor* type{};  ///< Made by idlc.
  std::string type_hash{};  ///< `RIHS01_…`, for ROS 2 from Iron on; empty: not a type of ROS.
};

struct Qos {
  bool reliable{true};
  bool for_late_joiners{false};  ///< Transient local: who comes later gets the newest.
  int depth{1};                  ///< Of the newest messages per instance, so many are kept.
  double deadline_s{0};          ///< Offered or asked for; 0: none.
};

/// A process's membership in one domain. Thread-safe.
class Participant final {
 public:
  /// @return Error naming the interface when there is no such one, or when this process is in the
  /// domain already.
  /// @param alarm  called once when others crowd the domain, on a thread of the middleware
  [[nodiscard]] static Expected<std::shared_ptr<Participant>> open(const NetworkConfig& config,
                                                                   CrowdWatch::Alarm alarm = {});

  [[nodiscard]] std::int32_t handle() const { return participant_.handle(); }
  [[nodiscard]] int domain() const { return domain_; }
  [[nodiscard]] Crowd crowd() const { return watch_->crowd(); }
  /// More others than can be true: whoever holds it should let go of it, that they are forgotten.
  [[nodiscard]] bool is_crowded() const { return watch_->is_crowded(); }

 private:
  Participant(std::unique_ptr<CrowdWatch> watch, Entity domain_entity, Entity participant,
              int domain)
      : watch_(std::move(watch)),
        domain_entity_(std::move(domain_entity)),
        participant_(std::move(participant)),
        domain_(domain) {}

  std::unique_ptr<CrowdWatch> watch_;  // goes last: is called until the others have gone
  Entity domain_entity_;
  Entity participant_;
  int domain_;
};

/// Writes one topic. Not thread-safe; readers are counted by the middleware's own threads.
class Writer final {
 public:
  [[nodiscard]] static Expected<Writer> make(const Participant& in, const TopicName& topic,
                                             const Qos& qos);

  [[nodiscard]] bool has_readers() const;
  /// Of each reader the participant it belongs to, as hexadecimal digits. For display: allocates.
  [[nodiscard]] std::vector<std::string> reading_participants() const;
  /// Never waits. @param sample  a struct of the topic's type; copied.
  /// @return false when the middleware does not take it: a reader that must not lose anything is
  /// too slow
  bool write(const void* sample);
  /// Several samples share a packet until `flush`; without it they stay in the machine.
  void flush();
  /// The instance of this key is no more.
  void dispose(const void* sample);

  [[nodiscard]] std::int32_t handle() const { return writer_.handle(); }
  [[nodiscard]] const std::string& topic() const { return name_; }
  [[nodiscard]] std::uint64_t written() const { return written_; }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

 private:
  Writer() = default;

  Entity topic_;
  Entity writer_;
  std::string name_;
  std::uint64_t written_{0};
  std::uint64_t refused_{0};
};

/// What the middleware means by a negative answer.
[[nodiscard]] std::string error_text(std::int32_t code);

}  // namespace fiducap::dds
