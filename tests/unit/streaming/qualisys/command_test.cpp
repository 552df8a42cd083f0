#include "streaming/qualisys/command.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap::qualisys {
namespace {

using testing::ElementsAre;

TEST(QualisysCommand, CaseAndSpacesDoNotMatter) {
  const Command command = split_command("  sTreamFrames   AllFrames  6d \r\n");
  EXPECT_TRUE(command.is("StreamFrames"));
  EXPECT_FALSE(command.is("StreamFrame"));
  EXPECT_THAT(words_of(command.rest), ElementsAre("AllFrames", "6d"));
}

TEST(QualisysCommand, EmptyTextIsAnEmptyCommand) {
  EXPECT_EQ(split_command("").name, "");
  EXPECT_EQ(split_command("  \n ").name, "");
}

TEST(QualisysCommand, ReadsEveryRate) {
  EXPECT_EQ(parse_stream_request("allframes 6D")->rate, (Rate{RateKind::kAllFrames, 1}));
  EXPECT_EQ(parse_stream_request("Frequency:60 6D")->rate, (Rate{RateKind::kFrequency, 60}));
  EXPECT_EQ(parse_stream_request("FREQUENCYDIVISOR:4 6D")->rate,
            (Rate{RateKind::kFrequencyDivisor, 4}));
}

TEST(QualisysCommand, RefusesRatesThatCannotBe) {
  for (const char* words :
       {"6D", "Frequency 6D", "Frequency: 6D", "Frequency:0 6D", "Frequency:-1 6D",
        "Frequency:1x 6D", "Frequency:99999999999999999999 6D", "FrequencyDivisor:0 6D",
        "Sometimes:3 6D", ""}) {
    EXPECT_FALSE(parse_stream_request(words)) << words;
  }
}

TEST(QualisysCommand, ReadsBothFormsOfUdp) {
  const auto own = parse_stream_request("AllFrames  UDP:6734 6DEuler 3DNoLabels");
  ASSERT_TRUE(own);
  EXPECT_EQ(own->udp_port, 6734);
  EXPECT_EQ(own->udp_address, "");
  EXPECT_TRUE(own->components.has(Component::k6dEuler));
  EXPECT_TRUE(own->components.has(Component::k3dNoLabels));
  EXPECT_FALSE(own->components.has(Component::k6d));
  const auto named = parse_stream_request("AllFrames udp:10.0.0.7:6734 6D");
  ASSERT_TRUE(named);
  EXPECT_EQ(named->udp_port, 6734);
  EXPECT_EQ(named->udp_address, "10.0.0.7");
  EXPECT_EQ(parse_stream_request("AllFrames 6D")->udp_port, std::nullopt);
}

TEST(QualisysCommand, RefusesUdpPortsThatCannotBe) {
  for (const char* words : {"AllFrames UDP: 6D", "AllFrames UDP:53 6D", "AllFrames UDP:65536 6D",
                            "AllFrames UDP:10.0.0.7: 6D", "AllFrames UDP:-1 6D"}) {
    EXPECT_FALSE(parse_stream_request(words)) << words;
  }
}

TEST(QualisysCommand, ComponentsHaveOptionsAndUnknownWordsAreSkipped) {
  const auto some = parse_components("6d skeleton:global NewFangled");
  ASSERT_TRUE(some);
  EXPECT_TRUE(some->has(Component::k6d));
  EXPECT_TRUE(some->has(Component::kSkeleton));
  EXPECT_FALSE(parse_components("NewFangled"));
  EXPECT_FALSE(parse_components(""));
  EXPECT_EQ(*parse_components("All"), Components::all());
}

TEST(QualisysCommand, KnowsTheVersionsThatThereAre) {
  EXPECT_EQ(parse_version("1.28")->minor, 28);
  EXPECT_EQ(parse_version("1.0")->minor, 0);
  for (const char* word : {"1.29", "2.0", "1.", "1.x", "1.-1", "255.255", "1.28 ", ""}) {
    EXPECT_FALSE(parse_version(word)) << word;
  }
}

TEST(QualisysCommand, KnowsTheGroupsOfParameters) {
  const auto some = parse_parameter_groups("general Skeleton:global");
  ASSERT_TRUE(some);
  EXPECT_TRUE(some->general && some->others);
  EXPECT_FALSE(some->six_d || some->three_d);
  const auto all = parse_parameter_groups("ALL");
  ASSERT_TRUE(all);
  EXPECT_TRUE(all->general && all->six_d && all->three_d);
  EXPECT_FALSE(parse_parameter_groups("Weather"));
  EXPECT_FALSE(parse_parameter_groups(""));
}

}  // namespace
}  // namespace fiducap::qualisys
