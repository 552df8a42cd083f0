#include "daemon/operator_token.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/system.hpp"
#include "middleware/net/peer.hpp"

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
      .errors;
}

Expected<std::string> read_token_file(const std::string& path) {
  // Not blocking: a pipe in its place must not delay the start.
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  struct stat about {};
  if (file.number() < 0 || ::fstat(file.number(), &about) != 0)
    return fail(ErrorCode::kNotFound,
                std::string("the operator's token cannot be read: ") + std::strerror(errno), path);
  if (const auto good = check_owner(about, path); !good) return tl::unexpected(good.error());
  std::array<char, kLongestToken + 1> text{};
  std::size_t size = 0;
  while (size < text.size()) {
    const ssize_t got = ::read(file.number(), text.data() + size, text.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0)
      return fail(ErrorCode::kUnavailable,
                  std::string("the operator's token cannot be read: ") + std::strerror(errno),
                  path);
    if (got == 0) return check_token({text.data(), size}, path);
    size += static_cast<std::size_t>(got);
  }
  return fail(ErrorCode::kInvalid, "is too long for a token", path);
}

Expected<std::string> operator_token(const OperatorConfig& config, const char* credentials) {
  if (!config.token.empty()) return config.token;
  if (!config.token_file.empty()) {
    auto token = read_token_file(config.token_file);
    if (token && token->empty())
      return fail(ErrorCode::kInvalid,
                  "is empty: write a token into it, or remove operator.token_file",
                  config.token_file);
    return token;
  }
  if (credentials == nullptr) return std::string();
  const std::filesystem::path handed = std::filesystem::path(credentials) / "token";
  std::error_code error;
  if (!std::filesystem::exists(handed, error)) return std::string();
  return read_token_file(handed.string());
}

std::string fresh_secret() {
  const auto key = net::random_key();
  return fmt::format("{:016x}{:016x}", key[0], key[1]);
}

bool is_secret(std::string_view given, std::string_view secret) {
  if (secret.empty() || given.size() != secret.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < given.size(); ++i)
    difference |= static_cast<unsigned char>(given[i]) ^ static_cast<unsigned char>(secret[i]);
  return difference == 0;
}

}  // namespace fiducap
