#pragma once

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace fiducap::web {

/// Headers of a request for a WebSocket.
inline const std::string kUpgrade =
    "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

inline constexpr char kText = '\x81';
inline constexpr char kBinary = '\x82';

/// A WebSocket message of less than 64 KiB. The mask is zero.
inline std::string web_socket(std::string_view message, char kind = kBinary) {
  const std::size_t size = message.size();
  std::string frame{kind};
  if (size < 126) {
    frame += static_cast<char>(0x80 | size);
  } else {
    for (const std::size_t part : {std::size_t{0xfe}, size >> 8, size & 0xff})
      frame += static_cast<char>(part);
  }
  return frame.append(4, '\0').append(message);
}

/// Runs the server until `done`, at most five seconds. @return whether it is done
inline bool run_until(boost::asio::io_context& io, const std::function<bool()>& done) {
  using namespace std::chrono_literals;
  const auto deadline = std::chrono::steady_clock::now() + 5s;
  while (!done()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    io.restart();
    io.run_for(1ms);
  }
  return true;
}

/// A client of the server under test that sends any bytes.
class LoopbackClient final {
 public:
  /// @param from  of 127.0.0.0/8: each is an address of its own
  LoopbackClient(boost::asio::io_context& io, std::uint16_t port, int receive_buffer = 0,
                 const char* from = "127.0.0.1")
      : io_(io), socket_(io) {
    const boost::asio::ip::tcp::endpoint at(boost::asio::ip::address_v4::loopback(), port);
    socket_.open(at.protocol());
    if (receive_buffer > 0)
      socket_.set_option(boost::asio::socket_base::receive_buffer_size(receive_buffer));
    socket_.bind({boost::asio::ip::make_address_v4(from), 0});
    socket_.connect(at);
    socket_.non_blocking(true);
  }

  /// Ignores errors: the server may have closed already.
  void send(const std::string& bytes) {
    boost::system::error_code ignored;
    socket_.non_blocking(false);
    boost::asio::write(socket_, boost::asio::buffer(bytes), ignored);
    socket_.non_blocking(true);
  }
  void get(const std::string& target, const std::string& headers = "") {
    send("GET " + target + " HTTP/1.1\r\nHost: hall:8080\r\n" + headers + "\r\n");
  }
  void upgrade(const std::string& headers = "", const std::string& target = "/api/v1/live") {
    get(target, kUpgrade + headers);
  }

  void say(const std::string& message, char kind = kBinary) { send(web_socket(message, kind)); }

  /// Reads all that has arrived. @return all bytes that were not taken yet
  std::string& received() {
    boost::system::error_code error;
    while (!error) {
      char chunk[65536];
      const std::size_t n = socket_.read_some(boost::asio::buffer(chunk), error);
      received_.append(chunk, n);
    }
    if (error != boost::asio::error::would_block) closed_ = true;
    return received_;
  }
  [[nodiscard]] bool closed() {
    received();
    return closed_;
  }
  bool wait_for(const std::string& text) {
    return run_until(io_, [&] { return received().find(text) != std::string::npos; });
  }
  bool wait_for_close() {
    return run_until(io_, [&] { return closed(); });
  }
  /// Removes the header of the answer. @return the upgrade was accepted
  bool wait_for_upgrade() {
    if (!wait_for("\r\n\r\n") || received_.rfind("HTTP/1.1 101", 0) != 0) return false;
    received_.erase(0, received_.find("\r\n\r\n") + 4);
    return true;
  }
  /// The text of the next WebSocket message that is no ping, nullopt after five seconds.
  std::optional<std::string> next_message() {
    std::optional<std::string> text;
    run_until(io_, [&] { return (text = take_message()).has_value(); });
    return text;
  }

 private:
  // RFC 6455 5.2; the server's messages are single unmasked frames.
  std::optional<std::string> take_message() {
    for (;;) {
      const std::string& in = received();
      if (in.size() < 2) return std::nullopt;
      const auto byte = [&](std::size_t i) {
        return static_cast<std::uint64_t>(static_cast<unsigned char>(in[i]));
      };
      const std::size_t extra = byte(1) == 127 ? 8 : byte(1) == 126 ? 2 : 0;
      if (in.size() < 2 + extra) return std::nullopt;
      std::uint64_t length = extra == 0 ? byte(1) : 0;
      for (std::size_t i = 0; i < extra; ++i) length = length << 8 | byte(2 + i);
      if (in.size() < 2 + extra + length) return std::nullopt;
      const bool is_control = (byte(0) & 0x08) != 0;
      std::string text = in.substr(2 + extra, length);
      received_.erase(0, 2 + extra + length);
      if (!is_control) return text;
    }
  }

  boost::asio::io_context& io_;
  boost::asio::ip::tcp::socket socket_;
  std::string received_;
  bool closed_{false};
};

}  // namespace fiducap::web
