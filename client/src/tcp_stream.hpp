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

  /// Every address of the host, one after the other. The look-up of a name alone may take longer
  /// than the deadline.
  /// @return empty, or why not.
  std::string open(const std::string& host, std::uint16_t port, Deadline deadline);
  void close();
  bool is_open() const { return fd_ >= 0; }
  /// The other end has closed, or speaks without being asked.
  void close_if_gone();
  /// @return there is something to read, be it the end
  bool wait_for_more(Deadline deadline) const;
  /// @return empty, or why not; then the stream is closed.
  std::string write(const void* bytes, std::size_t size, Deadline deadline);
  std::string read(void* bytes, std::size_t size, Deadline deadline);

 private:
  std::string fail(const std::string& why);

  int fd_{-1};
};

}  // namespace fiducap::sdk
