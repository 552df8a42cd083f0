#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "middleware/participant.hpp"

struct dds_topic_descriptor;

namespace fiducap::dds {

/// Name on the wire and type of a topic.
struct TopicName {
  std::string name;                    ///< As on the wire: `rt/tf`.
  const dds_topic_descriptor* type{};  ///< Made by idlc.
  std::string type_hash{};  ///< `RIHS01_…`, for ROS 2 from Iron on; empty: not a type of ROS.
};

struct Qos {
  bool reliable{true};
  bool for_late_joiners{false};  ///< Transient local: late readers get the newest messages.
  int depth{1};                  ///< Number of newest messages kept per instance.
  double deadline_s{0};          ///< Offered or requested; 0: none.
};

/// Writes one topic. Not thread-safe.
class Writer final {
 public:
  [[nodiscard]] static Expected<Writer> make(const Participant& in, const TopicName& topic,
                                             const Qos& qos);

  [[nodiscard]] bool has_readers() const;
  /// The participant of each reader, as hexadecimal digits. For display: allocates.
  [[nodiscard]] std::vector<std::string> reading_participants() const;
  /// Never waits. @param sample  a struct of the topic's type; copied
  /// @return false when the middleware refuses it: a reliable reader is too slow
  bool write(const void* sample);
  /// Sends the written samples; several share a packet.
  void flush();
  /// Ends the instance with the key of `sample`.
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

/// Reads one topic. Owned by one thread.
class Reader final {
 public:
  [[nodiscard]] static Expected<Reader> make(const Participant& in, const TopicName& topic,
                                             const Qos& qos);
  [[nodiscard]] std::int32_t handle() const { return reader_.handle(); }

  /// One message, on loan from the middleware.
  class Loan final {
   public:
    Loan() = default;
    Loan(std::int32_t reader, void* sample) : reader_(reader), sample_(sample) {}
    Loan(Loan&& other) noexcept
        : reader_(other.reader_), sample_(std::exchange(other.sample_, nullptr)) {}
    Loan& operator=(Loan&& other) noexcept {
      std::swap(reader_, other.reader_);
      std::swap(sample_, other.sample_);
      return *this;
    }
    Loan(const Loan&) = delete;
    Loan& operator=(const Loan&) = delete;
    ~Loan();
    [[nodiscard]] explicit operator bool() const { return sample_ != nullptr; }
    template <typename T>
    [[nodiscard]] const T& as() const {
      return *static_cast<const T*>(sample_);
    }

   private:
    std::int32_t reader_{0};
    void* sample_{nullptr};
  };

  /// @return the oldest message not taken yet; empty when there is none
  [[nodiscard]] Loan take();

 private:
  Reader() = default;

  Entity topic_;
  Entity reader_;
};

/// Waits for messages of several readers.
class WaitSet final {
 public:
  [[nodiscard]] static Expected<WaitSet> make(const Participant& in);
  /// @param reader  outlives the wait set
  [[nodiscard]] Expected<void> add(const Reader& reader);
  /// @return false when no message arrived within `timeout`
  [[nodiscard]] bool wait(Duration timeout);

 private:
  WaitSet() = default;

  Entity set_;
  std::vector<Entity> conditions_;
};

}  // namespace fiducap::dds
