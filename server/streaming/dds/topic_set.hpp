#pragma once

#include <optional>
#include <string>

#include "middleware/participant.hpp"
#include "streaming/dds/dds_config.hpp"

namespace fiducap::dds {

/// Makes writers one after the other and remembers the first that could not be made.
class TopicMaker final {
 public:
  TopicMaker(const Participant& in, const DdsConfig& config) : in_(in), config_(config) {}

  /// Forgets an earlier failure: a new model has a new chance.
  void begin() { failure_.reset(); }
  /// @return the writer; empty when not wanted or when one has failed before
  std::optional<Writer> make(bool wanted, const TopicName& topic, const Qos& qos) {
    if (!wanted || failure_) return std::nullopt;
    auto writer = Writer::make(in_, topic, qos);
    if (writer) return std::move(*writer);
    failure_ = writer.error();
    return std::nullopt;
  }
  /// For what comes again with every frame: the newest only.
  [[nodiscard]] Qos stream() const { return {config_.reliable, false, 1, 0}; }
  /// For what changes rarely: who comes later gets it, too.
  [[nodiscard]] static Qos kept() { return {true, true, 1, 0}; }
  [[nodiscard]] const DdsConfig& config() const { return config_; }
  [[nodiscard]] Expected<void> result() const {
    if (failure_) return tl::unexpected(*failure_);
    return {};
  }

 private:
  const Participant& in_;
  const DdsConfig& config_;
  std::optional<Error> failure_;
};

/// There is a subscriber.
[[nodiscard]] inline bool is_wanted(const std::optional<Writer>& writer) {
  return writer && writer->has_readers();
}

inline void send(std::optional<Writer>& writer, const void* sample) {
  writer->write(sample);
  writer->flush();
}

}  // namespace fiducap::dds
