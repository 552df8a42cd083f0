#pragma once

#include <cstdint>
#include <span>

#include "capture/import/import_parts.hpp"
#include "fuzz/memory_file.hpp"

namespace fiducap::fuzz {

/// Reads a log to its end: every byte of every message is there, topics are those that were met.
/// Then looks through it as an import does.
template <typename Open>
int read_message_log(Open open, const std::uint8_t* data, std::size_t size) {
  static const MemoryFile file;
  file.put(std::as_bytes(std::span(data, size)));
  auto log = open(file.path());
  if (!log) return 0;
  LoggedMessage message;
  std::uint64_t messages = 0;
  unsigned sum = 0;
  for (auto more = (*log)->next(message); more && *more; more = (*log)->next(message)) {
    require(message.topic < (*log)->topics().size());
    if (!message.bytes.empty())
      sum += std::to_integer<unsigned>(message.bytes.front()) +
             std::to_integer<unsigned>(message.bytes.back());
    ++messages;
  }
  require(sum <= messages * 510);
  require((*log)->share() <= 1);
  (void)(*log)->remarks();
  log = open(file.path());
  require(log.has_value());
  const auto survey = survey_log(**log, false, {});
  require(survey.has_value());
  std::uint64_t counted = 0;
  for (const FoundStream& stream : survey->streams) {
    counted += stream.count + stream.unreadable;
    require(stream.backwards + stream.zero_stamps <= stream.count);
    require(!stream.lens_known || stream.mount.model.check().empty());
  }
  require(counted <= messages);
  return 0;
}

}  // namespace fiducap::fuzz
