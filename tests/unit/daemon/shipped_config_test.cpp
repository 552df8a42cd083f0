// Every file under config/ must load.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/config/config_file.hpp"
#include "simulation/simulation.hpp"
#include "support/results.hpp"

namespace fiducap {
namespace {

const std::filesystem::path kFolder = std::filesystem::path(FIDUCAP_SOURCE_DIR) / "config";

std::vector<std::string> shipped() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(kFolder)) {
    if (entry.path().extension() != ".yaml") continue;
    names.push_back(entry.path().lexically_relative(kFolder).replace_extension().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

ServerConfig load(const std::string& name) {
  return value_of(load_config((kFolder / (name + ".yaml")).string()));
}

class ShippedConfig : public testing::TestWithParam<std::string> {};

TEST_P(ShippedConfig, LoadsAndPrintsToTheSame) {
  const std::string printed = print_config(load(GetParam()));
  EXPECT_EQ(print_config(value_of(parse_config(printed, "printed.yaml"))), printed);
}

TEST_P(ShippedConfig, GivesNoImuToTheFirstSender) {
  for (const BodyConfig& body : load(GetParam()).bodies) {
    const auto* link = body.imu_source ? body.imu_source->link() : nullptr;
    EXPECT_FALSE(link != nullptr && link->takes_the_first_sender()) << body.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Config, ShippedConfig, testing::ValuesIn(shipped()), [](const auto& test) {
  std::string name = test.param;  // setups/oak → setups_oak
  std::replace(name.begin(), name.end(), '/', '_');
  return name;
});

TEST(ShippedConfigs, AreTenSetupsAndTheFourOfTheReadme) {
  const auto names = shipped();
  EXPECT_GE(std::count_if(names.begin(), names.end(),
                          [](const std::string& name) { return name.starts_with("setups/"); }),
            10);
  EXPECT_THAT(names, testing::IsSupersetOf({"demo", "one_robot", "recording", "video"}));
}

TEST(DemoConfig, HasTheTruePoseOfItsReferenceTag) {
  // The workspace is the room only with the simulated pose; the file has 17 digits.
  constexpr double kRounding = 1e-12;
  const ServerConfig demo = load("demo");
  ASSERT_TRUE(demo.map.reference_tag && demo.map.reference_pose);
  const auto tags = simulation::tags_of(demo.simulation);
  const auto tag = std::find_if(tags.begin(), tags.end(),
                                [&](const auto& t) { return t.tag_id == *demo.map.reference_tag; });
  ASSERT_NE(tag, tags.end());
  EXPECT_LT((tag->X_WT.p - demo.map.reference_pose->p).norm(), kRounding);
  EXPECT_LT(tag->X_WT.q.angularDistance(demo.map.reference_pose->q), 1e-7);
}

}  // namespace
}  // namespace fiducap
