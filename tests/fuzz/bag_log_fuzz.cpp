// A bag of ROS 1 as anybody may have written it.
#include "capture/import/message_log.hpp"
#include "fuzz/message_log_stage.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fiducap::fuzz::read_message_log(fiducap::open_bag, data, size);
}
