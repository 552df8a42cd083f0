#include "streaming/conventions/client_names.hpp"

#include <gtest/gtest.h>

namespace fiducap {
namespace {

SceneModel model_of(const std::vector<std::string>& names) {
  SceneModel model;
  int id = 0;
  for (const auto& name : names) model.bodies.push_back({++id, name});
  return model;
}

TEST(ClientNames, WhatTheRuleForbidsBecomesAnUnderscore) {
  const NameRule ros{20, "-./", true, false};
  EXPECT_EQ(client_name("left-arm v2.1", ros), "left_arm_v2_1");
  EXPECT_EQ(client_name("größe", ros), "gr____e");
  EXPECT_EQ(client_name("größe", {}), "größe");
  EXPECT_EQ(client_name("a\nb\x7f", {}), "a_b_");
}

TEST(ClientNames, AnAliasStandsForTheNameAndObeysTheRuleToo) {
  EXPECT_EQ(client_name("drone", {}, {{"drone", "RigidBody 1"}}), "RigidBody 1");
  EXPECT_EQ(client_name("drone", {10, " "}, {{"drone", "RigidBody 1"}}), "RigidBody_");
}

TEST(ClientNames, ACutNeverSplitsACharacter) {
  EXPECT_EQ(client_name("abcö", {4}), "abc");
  EXPECT_EQ(client_name("abcö", {5}), "abcö");
}

TEST(ClientNames, NeverEmpty) {
  EXPECT_EQ(client_name("", {}), "_");
  EXPECT_EQ(client_name("öö", {1}), "_");
}

TEST(ClientNames, StayDistinctAfterCuttingAndReplacing) {
  EXPECT_EQ(client_names(model_of({"arm-1", "arm.1", "arm_1"}), {127, "-."}),
            (std::vector<std::string>{"arm_1", "arm_1_2", "arm_1_3"}));
  EXPECT_EQ(client_names(model_of({"walker-left", "walker-right"}), {7}),
            (std::vector<std::string>{"walker-", "walke_2"}));
}

}  // namespace
}  // namespace fiducap
