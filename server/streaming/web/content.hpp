#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/time.hpp"

namespace fiducap::web {

/// A body of an answer, made once for all who ask: plain and, where that is shorter, compressed.
struct Content {
  std::shared_ptr<const std::string> plain;
  std::shared_ptr<const std::string> gzip{};  ///< nullptr: not worth it.
};

/// How hard to look for a shorter text: once at the start, or again and again while serving.
enum class Effort { kQuick, kBest };

[[nodiscard]] Content make_content(std::string text, Effort effort);
/// Only plain.
[[nodiscard]] Content plain_content(std::string text);

/// @param accept_encoding  of a request, e.g. `gzip, deflate;q=0.5`
[[nodiscard]] bool accepts_gzip(std::string_view accept_encoding);

/// An answer that changes. Made when somebody asks, at most once per period, however many ask how
/// often.
class Prepared final {
 public:
  static constexpr Duration kPeriod = std::chrono::milliseconds(250);

  /// @param make  gives the text
  template <typename Make>
  [[nodiscard]] const Content& at(Instant now, Make&& make) {
    if (!made_at_ || now - *made_at_ >= kPeriod || now < *made_at_) {
      content_ = make_content(make(), Effort::kQuick);
      made_at_ = now;
    }
    return content_;
  }

 private:
  std::optional<Instant> made_at_;
  Content content_;
};

}  // namespace fiducap::web
