#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "streaming/page_api.hpp"

namespace fiducap {

/// A set-up that only records its calls.
class NotedSetup final : public SetupApi {
 public:
  static constexpr std::string_view kSecret = "00112233445566778899aabbccddeeff";

  bool admits(std::string_view secret) const override { return secret == kSecret; }
  std::shared_ptr<const std::string> state() const override {
    ++asked;
    return std::make_shared<const std::string>("{}");
  }
  std::shared_ptr<const std::string> picture() override {
    ++asked;
    return shown;
  }
  void note_refusal(const Requester& by) override { refused.push_back(by.address); }
  Expected<void> command(Requester by, std::string what,
                         std::map<std::string, std::string> values) override {
    from = std::move(by.address);
    ++asked;
    if (is_full) return fail(ErrorCode::kUnavailable, "too many commands wait");
    said = std::move(what);
    with = std::move(values);
    return {};
  }

  Expected<std::string> sheet(std::map<std::string, std::string> order) const override {
    ++asked;
    if (order["paper"] != "a4") return fail(ErrorCode::kInvalid, "must be a4", "paper");
    return "%PDF of " + order["family"];
  }

  std::shared_ptr<const std::string> shown;
  std::string said;
  std::string from;                  ///< Address of the client of the last command.
  std::vector<std::string> refused;  ///< Addresses of clients with a wrong secret.
  std::map<std::string, std::string> with;
  bool is_full{false};
  mutable int asked{0};  ///< Calls that need the secret.
};

}  // namespace fiducap
