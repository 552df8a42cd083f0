#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "support/hex.hpp"

namespace fiducap::vrpn {

/// Bytes of the real library, see tests/golden/vrpn/README.md.
inline std::vector<std::byte> golden(const std::string& name) {
  std::ifstream file(std::string(FIDUCAP_SOURCE_DIR) + "/tests/golden/vrpn/" + name + ".hex");
  EXPECT_TRUE(file) << name;
  std::ostringstream text;
  text << file.rdbuf();
  return from_hex(text.str());
}

}  // namespace fiducap::vrpn
