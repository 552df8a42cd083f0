#include "streaming/qualisys/discovery.hpp"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/address_v4.hpp>
#include <boost/asio/ip/host_name.hpp>
#include <span>
#include <utility>
#include <vector>

#include "streaming/net/bind.hpp"
#include "streaming/qualisys/codec.hpp"

namespace fiducap::qualisys {

using boost::asio::ip::udp;
using boost::system::error_code;

Expected<std::shared_ptr<Discovery>> Discovery::open(boost::asio::io_context& io,
                                                     const QualisysConfig& config,
                                                     std::uint16_t base_port, const Clock& clock) {
  error_code ignored;
  const auto address = boost::asio::ip::make_address_v4(config.address, ignored);
  // A broadcast does not reach a socket that is bound to one interface's address.
  const std::string listening = address.is_loopback() ? config.address : "0.0.0.0";
  auto socket =
      net::bind_udp(io, {listening, config.discovery_port, "streaming.qualisys", "discovery_port"});
  if (!socket) return tl::unexpected(socket.error());
  const std::string host = boost::asio::ip::host_name(ignored);
  const std::string about = host + ", QTM " + config.qtm_version + ", 0 cameras";
  auto discovery = std::make_shared<Discovery>(std::move(*socket), about, base_port, clock);
  discovery->receive();
  return discovery;
}

Discovery::Discovery(udp::socket socket, std::string about, std::uint16_t base_port,
                     const Clock& clock)
    : socket_(std::move(socket)),
      about_(std::move(about)),
      base_port_(base_port),
      clock_(clock),
      spent_at_(clock.now()) {}

void Discovery::receive() {
  receiving_ = true;
  socket_.async_receive_from(boost::asio::buffer(question_), asker_,
                             [self = shared_from_this()](const error_code& error, std::size_t n) {
                               self->receiving_ = false;
                               if (self->stopped_) return;
                               if (error) return;  // the next tick tries again
                               self->answer(n);
                               self->receive();
                             });
}

void Discovery::answer(std::size_t size) {
  const auto port = decode_discover(std::span<const std::byte>(question_).first(size));
  if (!port || !may_answer()) return;
  std::vector<std::byte> answer;
  encode_discover_answer(about_, base_port_, answer);
  error_code ignored;  // who asked may be gone
  socket_.send_to(boost::asio::buffer(answer), udp::endpoint(asker_.address(), *port), 0, ignored);
}

bool Discovery::may_answer() {
  const Instant now = clock_.now();
  spent_ = std::max(0.0, spent_ - to_seconds(now - spent_at_) * kPerSecond);
  spent_at_ = now;
  if (spent_ + 1 > kBurst) return false;
  spent_ += 1;
  return true;
}

void Discovery::tick() {
  if (!receiving_ && !stopped_) receive();
}

void Discovery::stop() {
  stopped_ = true;
  error_code ignored;
  socket_.close(ignored);
}

std::uint16_t Discovery::port() const {
  error_code ignored;
  return socket_.local_endpoint(ignored).port();
}

}  // namespace fiducap::qualisys
