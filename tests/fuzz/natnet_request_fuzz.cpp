// One datagram: the parser of requests, and behind it every command, to a server whose bodies can
// be changed.
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/expected.hpp"
#include "base/log.hpp"
#include "streaming/natnet/codec.hpp"
#include "streaming/natnet/commands.hpp"
#include "support/scene_builder.hpp"
#include "unit/streaming/natnet/fake_operator_api.hpp"

namespace fiducap::natnet {
namespace {

void obey(const CommandRequest& request) {
  static const auto frame = make_scene_frame({"arm", "drone", "left,leg"});
  static FakeOperatorApi operator_api;
  static ServerView server{NatNetConfig{}, &operator_api,        100,
                           frame->model,   frame->model->bodies, frame};
  static CommandWords words;
  Subscriber subscriber;
  const auto answer =
      words.answer(request.text, server, {{0x7f000001, 4000}, false, {3, 1}, &subscriber});
  FIDUCAP_ASSERT(answer.datagram.size() >= kHeaderSize);
  FIDUCAP_ASSERT(answer.datagram.size() <= kHeaderSize + kMaxText);
}

}  // namespace
}  // namespace fiducap::natnet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  log::set_level(log::Level::kError);
  const auto request = natnet::decode_request(std::as_bytes(std::span(data, size)));
  if (!request) return 0;
  if (const auto* command = std::get_if<natnet::CommandRequest>(&*request)) natnet::obey(*command);
  return 0;
}
