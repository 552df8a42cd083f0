// A configuration: an accepted one is printed, accepted again, and printed the same.
#include "daemon/config/config_file.hpp"
#include "fuzz/memory_file.hpp"

FUZZ(config_fuzz, input) {
  const auto config = parse_config(input.text(), "/f/fuzz.yaml");
  if (!config) {
    require(!config.error().empty());
    for (const ConfigFault& fault : config.error()) require(!fault.text().empty());
    return;
  }
  const std::string printed = print_config(*config);
  const auto again = parse_config(printed, "/f/printed.yaml");
  require(again.has_value());
  require(print_config(*again) == printed);
}
