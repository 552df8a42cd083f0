#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/qualisys/qualisys_config.hpp"

namespace fiducap::qualisys {

/// Answers "who is there?", which clients broadcast.
///
/// An answer is longer than its question and nobody has proven his address, so answers are few: 5
/// at once and 5 per second for the whole world. A flood of questions costs less than it brings.
class Discovery final : public std::enable_shared_from_this<Discovery> {
 public:
  static constexpr double kBurst = 5;
  static constexpr double kPerSecond = 5;

  /// @param base_port  what the answer says
  [[nodiscard]] static Expected<std::shared_ptr<Discovery>> open(boost::asio::io_context& io,
                                                                 const QualisysConfig& config,
                                                                 std::uint16_t base_port,
                                                                 const Clock& clock);
  Discovery(boost::asio::ip::udp::socket socket, std::string about, std::uint16_t base_port,
            const Clock& clock);
  /// Receives again after a failure; call now and then.
  void tick();
  void stop();
  [[nodiscard]] std::uint16_t port() const;

 private:
  void receive();
  void answer(std::size_t size);
  [[nodiscard]] bool may_answer();

  boost::asio::ip::udp::socket socket_;
  std::string about_;
  std::uint16_t base_port_;
  const Clock& clock_;
  boost::asio::ip::udp::endpoint asker_;
  std::array<std::byte, 64> question_{};
  bool receiving_{false};
  bool stopped_{false};
  double spent_{0};
  Instant spent_at_{};
};

}  // namespace fiducap::qualisys
