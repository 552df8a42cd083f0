#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>

namespace fiducap::sdk {

/// A TCP connection whose calls end at a deadline.
class TcpStream {
 public:
  using Deadline = std::chrono::steady_clock::time_point;

  TcpStream() = default;
  ~TcpStream() { close(); }
  TcpStream(const TcpStream&) = delete;
  TcpStream& operator=(const TcpStream&) = delete;

  /// Tries all addresses of the host. Only the look-up of a name may exceed the deadline.
  /// @return empty, or the cause of the failure
  std::string open(const std::string& host, std::uint16_t port, Deadline deadline);
  void close();
  bool is_open() const { return fd_ >= 0; }
  /// The other end has closed the connection or sent unrequested bytes.
  void close_if_gone();
  /// @return true: there is something to read, or the end
  bool wait_for_more(Deadline deadline) const;
  /// @return empty, or the cause of the failure; the stream is then closed
  std::string write(const void* bytes, std::size_t size, Deadline deadline);
  std::string read(void* bytes, std::size_t size, Deadline deadline);

 private:
  std::string fail(const std::string& why);

  int fd_{-1};
};

}  // namespace fiducap::sdk
