// Answers of a hostile server to a client that gives commands: all of them, one after the other, on
// a connection that says what the input says.
#include <cstring>

#include "fiducap/control.hpp"
#include "fuzz/memory_file.hpp"
#include "src/tcp_stream.hpp"

namespace {

std::span<const std::byte> g_said;  ///< What the server has still to say.

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
  if (g_said.size() < size) {
    g_said = {};
    close();
    return "the server has left";
  }
  if (size > 0) std::memcpy(bytes, g_said.data(), size);
  g_said = g_said.subspan(size);
  return {};
}

}  // namespace fiducap::sdk

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  g_said = std::as_bytes(std::span(data, size));
  ControlOptions options;
  options.server = "server";
  options.token = "correct horse";
  Control control(options);
  for (int i = 0; i < 4 && !g_said.empty(); ++i) {
    ControlState state;
    const Outcome listed = control.list(state);
    fuzz::require(listed || !listed.problem.empty());
    fuzz::require(state.bodies.size() <= size);
    const Outcome renamed = control.rename(1, "drone");
    fuzz::require(renamed || !renamed.problem.empty());
  }
  return 0;
}
