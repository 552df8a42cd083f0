#pragma once

#include <string>

#include "fiducap/v1/control.pb.h"
#include "src/tcp_stream.hpp"

namespace fiducap::sdk {

/// Length-prefixed messages of the control channel over a connection.
class MessageStream {
 public:
  using Deadline = TcpStream::Deadline;

  /// Connects and reads the server's greeting. @return empty, or the cause of the failure
  std::string open(const std::string& host, std::uint16_t port, Deadline deadline,
                   v1::ControlHello& hello);
  std::string write(const v1::ControlRequest& request, Deadline deadline);
  std::string read(v1::ControlReply& reply, Deadline deadline);
  TcpStream& tcp() { return tcp_; }

 private:
  TcpStream tcp_;
};

}  // namespace fiducap::sdk
