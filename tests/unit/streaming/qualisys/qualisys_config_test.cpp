#include "streaming/qualisys/qualisys.hpp"

#include <gtest/gtest.h>

namespace fiducap::qualisys {
namespace {

TEST(QualisysConfig, DefaultsAreGood) { EXPECT_TRUE(QualisysConfig{}.check().empty()); }

TEST(QualisysConfig, NamesEveryBrokenRuleAtOnce) {
  QualisysConfig config;
  config.address = "localhost";
  config.base_port = 65534;
  config.max_clients = 0;
  config.max_clients_per_address = 257;
  config.qtm_version = "2.17\n";
  const auto errors = config.check();
  ASSERT_EQ(errors.size(), 5u);
  EXPECT_EQ(errors[0].path, "streaming.qualisys.address");
  EXPECT_EQ(errors[1].path, "streaming.qualisys.base_port");
}

}  // namespace
}  // namespace fiducap::qualisys
