// A configuration: one that is accepted prints to what is accepted, and prints the same again.
#include "daemon/config/config_file.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  const auto config = parse_config({reinterpret_cast<const char*>(data), size}, "/f/fuzz.yaml");
  if (!config) {
    fuzz::require(!config.error().empty());
    for (const ConfigFault& fault : config.error()) fuzz::require(!fault.text().empty());
    return 0;
  }
  const std::string printed = print_config(*config);
  const auto again = parse_config(printed, "/f/printed.yaml");
  fuzz::require(again.has_value());
  fuzz::require(print_config(*again) == printed);
  return 0;
}
