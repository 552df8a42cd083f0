#include "daemon/operator_token.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/system.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kLongestToken = 1024;
constexpr mode_t kOfOthers = 0027;  // any access for others, and writing for the group

Expected<void> check_owner(const struct stat& file, const std::string& path) {
  if (!S_ISREG(file.st_mode)) return fail(ErrorCode::kInvalid, "must be a plain file", path);
  if (file.st_uid != 0 && file.st_uid != ::geteuid())
    return fail(ErrorCode::kInvalid,
                "belongs to another user, which could change the token: `chown` it to root or to "
                "the user of the server",
                path);
  if ((file.st_mode & kOfOthers) != 0)
    return fail(ErrorCode::kInvalid,
                "can be read or changed by others: `chmod 600` it, and choose a new token", path);
  return {};
}

Expected<std::string> check_token(std::string_view text, const std::string& path) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.remove_suffix(1);
  const bool one_line =
      std::ranges::all_of(text, [](unsigned char c) { return c >= 0x20 && c != 0x7f; });
  if (!one_line) return fail(ErrorCode::kInvalid, "must be one line of printable characters", path);
  if (!text.empty() && text.size() < kShortestToken)
    return fail(ErrorCode::kInvalid,
                "must have at least " + std::to_string(kShortestToken) + " characters, e.g. of " +
                    "`openssl rand -hex 16`",
                path);
  return std::string(text);
}

}  // namespace

std::vector<ConfigError> OperatorConfig::check() const {
  return Checker{"operator."}
      .require(token.empty() || token.size() >= kShortestToken, "token", "(secret)",
               "must have at least 8 characters, or be empty, which disables operators")
      .require(token.empty() || token_file.empty(), "token_file", token_file,
               "has no effect beside token: remove one of both")
      .require(read_token.empty() || read_token.size() >= kShortestToken, "read_token", "(secret)",
               "must have at least 8 characters, or be empty: reading needs no token then")
      .require(read_token.empty() || read_token_file.empty(), "read_token_file", read_token_file,
               "has no effect beside read_token: remove one of both")
      .errors;
}

Expected<std::string> read_token_file(const std::string& path) {
  // Not blocking: a pipe in its place must not delay the start.
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  struct stat about {};
  if (file.number() < 0 || ::fstat(file.number(), &about) != 0)
    return fail(ErrorCode::kNotFound,
                std::string("the token cannot be read: ") + std::strerror(errno), path);
  if (const auto good = check_owner(about, path); !good) return tl::unexpected(good.error());
  std::array<char, kLongestToken + 1> text{};
  std::size_t size = 0;
  while (size < text.size()) {
    const ssize_t got = ::read(file.number(), text.data() + size, text.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0)
      return fail(ErrorCode::kUnavailable,
                  std::string("the token cannot be read: ") + std::strerror(errno), path);
    if (got == 0) return check_token({text.data(), size}, path);
    size += static_cast<std::size_t>(got);
  }
  return fail(ErrorCode::kInvalid, "is too long for a token", path);
}

namespace {

/// @param credential  name of the service manager's
Expected<std::string> token_of(const std::string& text, const std::string& file,
                               const std::string& key, const char* credentials,
                               const char* credential) {
  if (!text.empty()) return text;
  if (!file.empty()) {
    auto token = read_token_file(file);
    if (token && token->empty())
      return fail(ErrorCode::kInvalid, "is empty: write a token into it, or remove " + key, file);
    return token;
  }
  if (credentials == nullptr) return std::string();
  const std::filesystem::path handed = std::filesystem::path(credentials) / credential;
  std::error_code error;
  if (!std::filesystem::exists(handed, error)) return std::string();
  return read_token_file(handed.string());
}

}  // namespace

Expected<OperatorConfig> with_tokens(OperatorConfig config, const char* credentials) {
  auto token =
      token_of(config.token, config.token_file, "operator.token_file", credentials, "token");
  if (!token) return tl::unexpected(token.error());
  auto read_token = token_of(config.read_token, config.read_token_file, "operator.read_token_file",
                             credentials, "read_token");
  if (!read_token) return tl::unexpected(read_token.error());
  config.token = std::move(*token);
  config.read_token = std::move(*read_token);
  return config;
}

}  // namespace fiducap
