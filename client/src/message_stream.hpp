#pragma once

#include <string>

#include "fiducap/v1/control.pb.h"
#include "src/tcp_stream.hpp"

namespace fiducap::sdk {

/// Messages of the control channel over a connection, each behind its length.
class MessageStream {
 public:
  using Deadline = TcpStream::Deadline;

  /// Connects and takes the server's greeting. @return empty, or why not
  std::string open(const std::string& host, std::uint16_t port, Deadline deadline,
                   v1::ControlHello& hello);
  std::string write(const v1::ControlRequest& request, Deadline deadline);
  std::string read(v1::ControlReply& reply, Deadline deadline);
  TcpStream& tcp() { return tcp_; }

 private:
  TcpStream tcp_;
};

}  // namespace fiducap::sdk
