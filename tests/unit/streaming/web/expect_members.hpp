#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace fiducap::web {

/// Expects these members of an object; it may have others.
inline void expect_members(const nlohmann::json& object, const char* members) {
  const auto expected = nlohmann::json::parse(members);
  for (const auto& [name, value] : expected.items()) EXPECT_EQ(object.at(name), value) << name;
}

}  // namespace fiducap::web
