#include "streaming/net/repeated_wait.hpp"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <vector>

#include "base/log.hpp"

namespace fiducap::net {

namespace {

/// All repeated waits of one io_context.
class WaitRegister final : public boost::asio::execution_context::service {
 public:
  using key_type = WaitRegister;
  static inline boost::asio::execution_context::id id;

  explicit WaitRegister(boost::asio::execution_context& context) : service(context) {}
  void shutdown() override {}

  void add(const std::shared_ptr<RepeatedWait>& wait) {
    std::erase_if(waits_, [](const auto& held) { return held.expired(); });
    waits_.push_back(wait);
  }

  bool resume() noexcept {
    bool all = true;
    for (const auto& held : waits_) {
      const auto wait = held.lock();
      const auto whose = [] { return std::string("a wait is resumed later"); };
      if (wait && !log::guarded("net", whose, [&] { wait->resume(); })) all = false;
    }
    return all;
  }

 private:
  std::vector<std::weak_ptr<RepeatedWait>> waits_;
};

}  // namespace

void register_wait(boost::asio::io_context& io, const std::shared_ptr<RepeatedWait>& wait) {
  boost::asio::use_service<WaitRegister>(io).add(wait);
}

bool resume_waits(boost::asio::io_context& io) noexcept {
  return !boost::asio::has_service<WaitRegister>(io) ||
         boost::asio::use_service<WaitRegister>(io).resume();
}

}  // namespace fiducap::net
