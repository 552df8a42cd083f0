// Messages of ROS, serialised by ROS 1 or as CDR. The first byte chooses dialect and type.
#include "capture/import/ros_messages.hpp"
#include "fuzz/memory_file.hpp"

namespace {

template <typename Data>
void within(const Data& part, std::span<const std::byte> whole) {
  const auto* begin = reinterpret_cast<const std::byte*>(part.data());
  fiducap::fuzz::require(part.empty() || (begin >= whole.data() &&
                                          begin + part.size() <= whole.data() + whole.size()));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  const fuzz::Chosen input(data, size, 8);
  const MessageFormat format = input.which < 4 ? MessageFormat::kRos1 : MessageFormat::kCdr;
  switch (input.which % 4) {
    case 0:
      (void)ros::read_imu(format, input.bytes);
      break;
    case 1:
      if (const auto read = ros::read_image(format, input.bytes)) {
        within(read->image.data, input.bytes);
        within(read->image.encoding, input.bytes);
      }
      break;
    case 2:
      if (const auto read = ros::read_compressed(format, input.bytes))
        within(read->data, input.bytes);
      break;
    default:
      if (const auto lens = ros::read_lens(format, input.bytes))
        fuzz::require(lens->check().empty());
  }
  return 0;
}
