#include "base/yaml.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap {
namespace {

using testing::HasSubstr;

TEST(YamlText, AnAliasRepeatsWhatItNames) {
  const auto root = load_yaml("lens: &l {fu: 500}\ncameras: [{model: *l}, {model: *l}]\n");
  ASSERT_TRUE(root) << root.error().text();
  EXPECT_EQ((*root)["cameras"][1]["model"]["fu"].as<int>(), 500);
}

TEST(YamlText, ASecondDocumentIsRefused) {
  const auto root = load_yaml("tags: {size_m: 0.1}\n---\noperator: {token: secret}\n");
  ASSERT_FALSE(root);
  EXPECT_THAT(root.error().text(), HasSubstr("holds 2 documents"));
  EXPECT_TRUE(load_yaml("---\ntags: {size_m: 0.1}\n"));
  EXPECT_TRUE(load_yaml("# nothing\n"));
}

TEST(YamlText, AnAliasInsideOfWhatItRepeatsIsRefusedWithPathAndRule) {
  const auto root = load_yaml("tags: {}\nbodies: &a [{name: b}, *a]\n");
  ASSERT_FALSE(root);
  EXPECT_EQ(root.error().line, 2);
  EXPECT_EQ(root.error().text(),
            "bodies.1 = an alias: repeats the list or section that contains it");
}

TEST(YamlText, AShortTextDoesNotBecomeAnEndlessOne) {
  std::string text = "l0: &l0 [x, x, x, x, x, x, x, x, x]\n";
  for (int level = 1; level < 12; ++level) {
    const std::string below = "*l" + std::to_string(level - 1);
    text += "l" + std::to_string(level) + ": &l" + std::to_string(level) + " [" + below;
    for (int i = 0; i < 8; ++i) text += ", " + below;
    text += "]\n";
  }
  const auto root = load_yaml(text);
  ASSERT_FALSE(root);
  EXPECT_THAT(root.error().text(), HasSubstr("aliases repeat more than 10000 values"));
  EXPECT_THAT(root.error().path, HasSubstr("l4"));
}

TEST(YamlText, AliasesDoNotMakeATextDeep) {
  std::string text = "l0: &l0 [x]\n";
  for (int level = 1; level < 20; ++level)
    text += "l" + std::to_string(level) + ": &l" + std::to_string(level) + " [[[[[[[[*l" +
            std::to_string(level - 1) + "]]]]]]]]\n";
  const auto root = load_yaml(text);
  ASSERT_FALSE(root);
  EXPECT_THAT(root.error().text(), HasSubstr("is deeper than 100 levels"));
}

TEST(YamlText, AFaultHasItsLine) {
  for (const std::string& text :
       {std::string("a: 1\nb: [1, 2\n"), "a: 1\n" + std::string(20'000, '['),
        std::string("a: 1\nb: *unknown\n")}) {
    const auto root = load_yaml(text);
    ASSERT_FALSE(root);
    EXPECT_THAT(root.error().text(), HasSubstr("is not YAML"));
    EXPECT_GE(root.error().line, 2);
  }
}

}  // namespace
}  // namespace fiducap
