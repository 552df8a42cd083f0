#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "middleware/participant.hpp"

namespace fiducap::dds {

/// Reads one topic. Owned by one thread.
class Reader final {
 public:
  [[nodiscard]] static Expected<Reader> make(const Participant& in, const TopicName& topic,
                                             const Qos& qos);
  [[nodiscard]] std::int32_t handle() const { return reader_.handle(); }

  /// One message on loan from the middleware.
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

  /// @return the oldest message not taken yet; empty when there is none.
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
  /// @return true when a message is there before `patience` is over
  [[nodiscard]] bool wait(Duration patience);

 private:
  WaitSet() = default;

  Entity set_;
  std::vector<Entity> conditions_;
};

}  // namespace fiducap::dds
