// Replies of a hostile server to a client that gives commands, on a connection that delivers the
// input.
#include <cstring>

#include "fiducap/control.hpp"
#include "fuzz/memory_file.hpp"
#include "src/tcp_stream.hpp"

namespace {

std::span<const std::byte> g_replies;  ///< Not yet read.

}  // namespace

// In place of the real connection, which the linker then leaves out.
namespace fiducap::sdk {

std::string TcpStream::open(const std::string&, std::uint16_t, Deadline) {
  fd_ = 1'000'000;
  return {};
}
void TcpStream::close() { fd_ = -1; }
void TcpStream::close_if_gone() {}
std::string TcpStream::write(const void*, std::size_t, Deadline) { return {}; }
std::string TcpStream::read(void* bytes, std::size_t size, Deadline) {
  if (g_replies.size() < size) {
    g_replies = {};
    close();
    return "the server has left";
  }
  if (size > 0) std::memcpy(bytes, g_replies.data(), size);
  g_replies = g_replies.subspan(size);
  return {};
}

}  // namespace fiducap::sdk

FUZZ(client_control_fuzz, input) {
  g_replies = input.bytes;
  ControlOptions options;
  options.server = "server";
  options.token = "correct horse";
  Control control(options);
  for (int i = 0; i < 4 && !g_replies.empty(); ++i) {
    ControlState state;
    const Outcome listed = control.list(state);
    require(listed || !listed.problem.empty());
    require(state.bodies.size() <= input.bytes.size());
    const Outcome renamed = control.rename(1, "drone");
    require(renamed || !renamed.problem.empty());
  }
}
