// Recordings of other programs.
#include "capture/import/import_parts.hpp"
#include "capture/import/imu_csv.hpp"
#include "capture/import/input_file.hpp"
#include "capture/import/message_log.hpp"
#include "capture/import/ros_messages.hpp"
#include "fuzz/memory_file.hpp"

namespace {

/// Reads a log to its end: all bytes of all messages are there, topics are known ones. Then surveys
/// it as an import does.
template <typename Open>
void read_message_log(Open open, const Input& input) {
  static const MemoryFile file;
  file.put(input.bytes);
  auto log = open(file.path());
  if (!log) return;
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
}

template <typename Data>
void within(const Data& part, std::span<const std::byte> whole) {
  const auto* begin = reinterpret_cast<const std::byte*>(part.data());
  require(part.empty() ||
          (begin >= whole.data() && begin + part.size() <= whole.data() + whole.size()));
}

}  // namespace

FUZZ(bag_log_fuzz, input) { read_message_log(open_bag, input); }
FUZZ(mcap_log_fuzz, input) { read_message_log(open_mcap, input); }

// Serialised by ROS 1 or as CDR. The first byte chooses dialect and type.
FUZZ(ros_messages_fuzz, input) {
  const unsigned which = input.choose(8);
  const MessageFormat format = which < 4 ? MessageFormat::kRos1 : MessageFormat::kCdr;
  if (which % 4 == 0) {
    (void)ros::read_imu(format, input.bytes);
  } else if (which % 4 == 1) {
    const auto read = ros::read_image(format, input.bytes);
    if (!read) return;
    within(read->image.data, input.bytes);
    within(read->image.encoding, input.bytes);
  } else if (which % 4 == 2) {
    if (const auto read = ros::read_compressed(format, input.bytes))
      within(read->image.data, input.bytes);
  } else if (const auto lens = ros::read_lens(format, input.bytes)) {
    require(lens->check().empty());
  }
}

// The table of an IMU, with any header.
FUZZ(imu_csv_fuzz, input) {
  static const MemoryFile file;
  file.put(input.bytes);
  const auto table = read_imu_csv(file.path(), {});
  if (!table) return;
  require(table->samples.size() <= input.bytes.size());
  for (std::size_t i = 1; i < table->samples.size(); ++i)
    require(table->samples[i].sampled_at > table->samples[i - 1].sampled_at);
}

// The directory of a ZIP archive, and its first files.
FUZZ(zip_archive_fuzz, input) {
  static const MemoryFile file, out;
  file.put(input.bytes);
  auto archive = ZipArchive::open(file.path());
  if (!archive) return;
  constexpr std::size_t kTried = 4;
  for (std::size_t i = 0; i < std::min(kTried, archive->entries().size()); ++i) {
    const ZipEntry& entry = archive->entries()[i];
    const bool unpacked = archive->unpack(entry, out.path()).has_value();
    std::error_code error;
    if (unpacked) require(std::filesystem::file_size(out.path(), error) == entry.bytes);
  }
}
