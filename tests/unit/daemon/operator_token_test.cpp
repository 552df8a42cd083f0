#include "daemon/operator_token.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "daemon/operator_service.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

class OperatorTokenTest : public testing::Test {
 protected:
  std::string write(const std::string& text, mode_t mode = 0600) {
    const std::string path = folder_.file("token");
    std::ofstream(path, std::ios::binary) << text;
    EXPECT_EQ(::chmod(path.c_str(), mode), 0);
    return path;
  }
  std::string refusal(const std::string& text, mode_t mode = 0600) {
    const auto token = read_token_file(write(text, mode));
    return token ? "taken: " + *token : token.error().text();
  }

  TemporaryFolder folder_;
};

TEST_F(OperatorTokenTest, IsTheLineOfTheFileWithoutItsEnd) {
  for (const char* text : {"correct horse", "correct horse\n", "correct horse\r\n"}) {
    const auto token = read_token_file(write(text));
    ASSERT_TRUE(token) << token.error().text();
    EXPECT_EQ(*token, "correct horse");
  }
}

TEST_F(OperatorTokenTest, AFileThatOthersCanReadOrChangeHoldsNoSecret) {
  for (const mode_t mode : {0604, 0602, 0601, 0620, 0666})
    EXPECT_THAT(refusal("correct horse", mode), HasSubstr("chmod 600")) << std::oct << mode;
  EXPECT_TRUE(read_token_file(write("correct horse", 0440)))
      << "a credential of systemd shows its access list as rights of the group";
}

TEST_F(OperatorTokenTest, WhatIsNoTokenIsRefusedWithTheFilesName) {
  EXPECT_THAT(refusal("short"), HasSubstr("at least 8 characters"));
  EXPECT_THAT(refusal("two lines\nof a file"), HasSubstr("one line"));
  EXPECT_THAT(refusal(std::string("nul\0 inside", 11)), HasSubstr("one line"));
  EXPECT_THAT(refusal(std::string(1025, 'a')), HasSubstr("too long"));
  EXPECT_THAT(refusal("short"), HasSubstr(folder_.file("token")));
}

TEST_F(OperatorTokenTest, WhatIsNoFileIsRefusedAtOnce) {
  EXPECT_THAT(read_token_file(folder_.file("none")).error().text(), HasSubstr("No such file"));
  EXPECT_THAT(read_token_file(std::filesystem::path(folder_.file("x")).parent_path().string())
                  .error()
                  .text(),
              HasSubstr("plain file"));
  const std::string pipe = folder_.file("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(read_token_file(pipe).error().text(), HasSubstr("plain file"));
}

TEST_F(OperatorTokenTest, TheConfigurationGoesBeforeTheCredential) {
  const std::string file = write("of the file\n");
  const std::string folder = std::filesystem::path(file).parent_path().string();
  EXPECT_EQ(operator_token({"of the text", ""}, folder.c_str()), "of the text");
  EXPECT_EQ(operator_token({"", file}, "/nowhere"), "of the file");
  EXPECT_EQ(operator_token({}, folder.c_str()), "of the file");
  EXPECT_EQ(operator_token({}, nullptr), "");
  EXPECT_EQ(operator_token({}, "/nowhere"), "") << "a service without this credential";
}

TEST_F(OperatorTokenTest, AnEmptyCredentialIsNoneButAnEmptyFileIsAMistake) {
  const std::string file = write("\n");
  const std::string folder = std::filesystem::path(file).parent_path().string();
  EXPECT_EQ(operator_token({}, folder.c_str()), "");
  const auto named = operator_token({"", file}, nullptr);
  ASSERT_FALSE(named);
  EXPECT_THAT(named.error().text(), HasSubstr("is empty"));
}

TEST_F(OperatorTokenTest, TwoTokensAreATypingError) {
  EXPECT_TRUE((OperatorConfig{"", "/etc/token"}.check().empty()));
  const auto faults = OperatorConfig{"correct horse", "/etc/token"}.check();
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_THAT(faults[0].text(), HasSubstr("remove one of"));
  EXPECT_THAT(faults[0].text(), testing::Not(HasSubstr("correct horse")));
}

}  // namespace
}  // namespace fiducap
