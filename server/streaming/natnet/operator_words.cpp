#include "streaming/natnet/operator_words.hpp"

#include <algorithm>

#include "base/log.hpp"
#include "streaming/natnet/properties.hpp"

namespace fiducap::natnet {

namespace {

constexpr std::int32_t kDone = 0;
constexpr std::int32_t kRefused = 1;
constexpr std::size_t kMaxTakeName = 128;

Expected<OperatorDesk::Body> body_of(const Command& command, const ServerView& server) {
  if (auto body = find_body(server, command[0])) return *body;
  return fail(ErrorCode::kNotFound, "no body of this name or id");
}

std::string shown(std::string_view text) {
  constexpr std::size_t kMost = 60;
  std::string out(text.substr(0, kMost));
  std::replace_if(
      out.begin(), out.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return out;
}

}  // namespace

struct OperatorWords::Word {
  std::string_view text;
  Handler handler;
};

const OperatorWords::Word OperatorWords::kWords[] = {
    {"StartRecording", &OperatorWords::start_recording},
    {"StopRecording", &OperatorWords::stop_recording},
    {"SetRecordTakeName", &OperatorWords::set_take_name},
    {"EnableAsset", &OperatorWords::enable},
    {"DisableAsset", &OperatorWords::disable},
    {"ResetAssetOrientation", &OperatorWords::reset_orientation},
    {"ResetAssetLocation", &OperatorWords::reset_location},
    {"RecalibrateAsset", &OperatorWords::unsupported},
    {"SetProperty", &OperatorWords::set_property},
};

std::optional<Datagram> OperatorWords::answer(const Command& command, const ServerView& server,
                                              const Peer& from) {
  const auto at = std::find_if(std::begin(kWords), std::end(kWords),
                               [&](const Word& word) { return word.text == command.word; });
  if (at == std::end(kWords)) return std::nullopt;
  const std::string what = std::string(at->text) + " " + shown(command[0]) + " of " + text_of(from);
  if (!may_change(server, from)) {
    log::info("natnet", what + " refused: streaming.natnet.remote_control does not allow it");
    return encode_response(kRefused);
  }
  const auto done = (this->*at->handler)(command, server);
  if (done) {
    log::info("natnet", what + ": done");
  } else {
    log::info("natnet", what + " refused: " + done.error().text());
  }
  return encode_response(done ? kDone : kRefused);
}

Expected<void> OperatorWords::start_recording(const Command&, const ServerView& server) {
  auto started = server.desk->start_recording(next_take_);
  if (started) next_take_.clear();  // one name, one take
  return started;
}

Expected<void> OperatorWords::stop_recording(const Command&, const ServerView& server) {
  return server.desk->stop_recording();
}

Expected<void> OperatorWords::set_take_name(const Command& command, const ServerView&) {
  if (command[0].empty() || command[0].size() > kMaxTakeName) {
    return fail(ErrorCode::kInvalid, "a take's name has 1 to 128 bytes");
  }
  next_take_ = command[0];
  return {};
}

Expected<void> OperatorWords::enable(const Command& command, const ServerView& server) {
  const auto body = body_of(command, server);
  if (!body) return tl::unexpected(body.error());
  return server.desk->set_enabled(body->id, true);
}

Expected<void> OperatorWords::disable(const Command& command, const ServerView& server) {
  const auto body = body_of(command, server);
  if (!body) return tl::unexpected(body.error());
  return server.desk->set_enabled(body->id, false);
}

Expected<void> OperatorWords::reset_orientation(const Command& command, const ServerView& server) {
  const auto body = body_of(command, server);
  if (!body) return tl::unexpected(body.error());
  const BodyPose* now = nullptr;
  if (server.frame) {
    for (const BodyPose& pose : server.frame->bodies) {
      if (pose.body_id == body->id && pose.valid) now = &pose;
    }
  }
  if (now == nullptr)
    return fail(ErrorCode::kUnavailable, "the body is not tracked: how it stands is not known");
  // The pivot turns so that the body, as it stands now, has attitude 1: q_WP q_PP' = 1.
  return server.desk->set_pivot(body->id, {body->X_BP.q * now->X_WP.q.conjugate(), body->X_BP.p});
}

Expected<void> OperatorWords::reset_location(const Command& command, const ServerView& server) {
  const auto body = body_of(command, server);
  if (!body) return tl::unexpected(body.error());
  return server.desk->set_pivot(body->id, {body->X_BP.q, Eigen::Vector3d::Zero()});
}

Expected<void> OperatorWords::set_property(const Command& command, const ServerView& server) {
  return fiducap::natnet::set_property(command, server);
}

Expected<void> OperatorWords::unsupported(const Command&, const ServerView&) {
  return fail(ErrorCode::kUnsupported, "has no meaning for a body that sees tags");
}

}  // namespace fiducap::natnet
