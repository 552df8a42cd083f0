#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <tl/expected.hpp>
#include <utility>

/// Ends the process when a contract inside our own code is broken. Active in all builds.
#define FIDUCAP_ASSERT(condition)                                                          \
  do {                                                                                     \
    if (!(condition)) {                                                                    \
      std::fprintf(stderr, "fiducap bug: %s does not hold, %s:%d\n", #condition, __FILE__, \
                   __LINE__);                                                              \
      std::abort();                                                                        \
    }                                                                                      \
  } while (false)

namespace fiducap {

/// Kind of failure; decides what a caller can do about it.
enum class ErrorCode {
  kNotFound,     ///< File, device or name is not there.
  kInvalid,      ///< Content breaks a rule of its format.
  kTruncated,    ///< Content ends too early.
  kUnsupported,  ///< Well formed, but not supported.
  kUnavailable,  ///< Device, port or disk cannot be used right now.
  kClosed,       ///< The other side ended.
};

/// A failure of the outside world (device, peer, file, bytes). Own bugs are FIDUCAP_ASSERT instead.
struct Error {
  ErrorCode code{ErrorCode::kInvalid};
  std::string what;     ///< One sentence: what was expected, what came, what to do next.
  std::string context;  ///< Where: path with line, peer address, device.

  [[nodiscard]] std::string text() const { return context.empty() ? what : context + ": " + what; }
};

template <typename T>
using Expected = tl::expected<T, Error>;

[[nodiscard]] inline tl::unexpected<Error> fail(ErrorCode code, std::string what,
                                                std::string context = {}) {
  return tl::unexpected<Error>(Error{code, std::move(what), std::move(context)});
}

}  // namespace fiducap
