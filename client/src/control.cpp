#include "fiducap/control.hpp"

#include <google/protobuf/arena.h>

#include <utility>

#include "proof/control_proof.hpp"
#include "src/message_stream.hpp"

namespace fiducap {

namespace {

ControlledBody to_body(const v1::ControlBody& in) {
  ControlledBody out;
  out.id = static_cast<int>(in.id());
  out.name = in.name();
  out.enabled = in.enabled();
  if (in.position_size() == 3) {
    for (int i = 0; i < 3; ++i) out.pivot_position_m[static_cast<std::size_t>(i)] = in.position(i);
  }
  if (in.orientation_wxyz_size() == 4) {
    for (int i = 0; i < 4; ++i)
      out.pivot_orientation_wxyz[static_cast<std::size_t>(i)] = in.orientation_wxyz(i);
  }
  return out;
}

Recording to_recording(const v1::ControlRecording& in) {
  return {in.name(),   static_cast<RecordingState>(in.state()),
          in.reason(), in.samples(),
          in.bytes(),  in.dropped()};
}

}  // namespace

class Control::Impl {
 public:
  explicit Impl(ControlOptions options) : options_(std::move(options)) {}

  /// @param fill  sets the command's fields; strings by moving, because the arena destroys a string
  ///              even if its copy has failed
  template <typename Fill>
  Outcome run(Fill&& fill) {
    v1::ControlReply reply;
    return run(std::forward<Fill>(fill), reply);
  }
  template <typename Fill>
  Outcome run(Fill&& fill, v1::ControlReply& reply) {
    google::protobuf::Arena arena;  // for a oneof, see `make_datagram`
    auto& command = *google::protobuf::Arena::CreateMessage<v1::ControlCommand>(&arena);
    fill(command);
    return send(command, reply);
  }

 private:
  using Deadline = sdk::MessageStream::Deadline;

  Outcome send(const v1::ControlCommand& command, v1::ControlReply& reply) {
    const auto deadline = std::chrono::steady_clock::now() + options_.timeout;
    stream_.tcp().close_if_gone();
    const std::string problem = ask(command, reply, deadline);
    if (!problem.empty()) return {false, where() + problem};
    if (reply.result() == v1::ControlReply::RESULT_DONE) return {true, {}};
    return {false, reply.text().empty() ? "the server refused" : reply.text()};
  }

  std::string where() const { return options_.server + ":" + std::to_string(options_.port) + ": "; }

  std::string ask(const v1::ControlCommand& command, v1::ControlReply& reply, Deadline deadline) {
    if (!stream_.tcp().is_open()) {
      if (auto problem = connect(deadline); !problem.empty()) return problem;
    }
    v1::ControlRequest request;
    const std::string body = command.SerializeAsString();
    const auto proof = proof::control_proof(options_.token, challenge_, ++sequence_, body);
    request.set_sequence(sequence_);
    request.set_proof(std::string(proof.begin(), proof.end()));
    request.set_body(body);
    if (auto problem = stream_.write(request, deadline); !problem.empty()) return problem;
    auto problem = stream_.read(reply, deadline);
    if (problem.empty() && reply.sequence() != sequence_) {
      stream_.tcp().close();
      return "the reply belongs to another command";
    }
    return problem;
  }

  std::string connect(Deadline deadline) {
    v1::ControlHello hello;
    auto problem = stream_.open(options_.server, options_.port, deadline, hello);
    challenge_ = hello.challenge();
    sequence_ = 0;
    return problem;
  }

  ControlOptions options_;
  sdk::MessageStream stream_;
  std::string challenge_;
  std::uint64_t sequence_{0};
};

Control::Control(ControlOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}

Control::~Control() = default;

Outcome Control::list(ControlState& state) {
  v1::ControlReply reply;
  Outcome outcome =
      impl_->run([](v1::ControlCommand& command) { command.mutable_list_bodies(); }, reply);
  if (!outcome) return outcome;
  state = {};
  for (const auto& body : reply.state().bodies()) state.bodies.push_back(to_body(body));
  state.mapping = reply.state().mapping();
  state.recording = reply.state().recording();
  state.map_version = reply.state().map_version();
  for (const auto& recording : reply.state().recordings())
    state.recordings.push_back(to_recording(recording));
  return outcome;
}

Outcome Control::set_enabled(int body_id, bool enabled) {
  return impl_->run([&](v1::ControlCommand& command) {
    command.mutable_set_enabled()->set_body_id(static_cast<std::uint32_t>(body_id));
    command.mutable_set_enabled()->set_enabled(enabled);
  });
}

Outcome Control::rename(int body_id, const std::string& name) {
  return impl_->run([&](v1::ControlCommand& command) {
    command.mutable_rename()->set_body_id(static_cast<std::uint32_t>(body_id));
    command.mutable_rename()->set_name(std::string(name));
  });
}

Outcome Control::set_pivot(int body_id, const std::array<double, 3>& position_m,
                           const std::array<double, 4>& orientation_wxyz) {
  return impl_->run([&](v1::ControlCommand& command) {
    auto& pivot = *command.mutable_set_pivot();
    pivot.set_body_id(static_cast<std::uint32_t>(body_id));
    for (const double part : position_m) pivot.add_position(part);
    for (const double part : orientation_wxyz) pivot.add_orientation_wxyz(part);
  });
}

Outcome Control::set_mapping(bool mapping) {
  return impl_->run(
      [&](v1::ControlCommand& command) { command.mutable_set_map_mode()->set_mapping(mapping); });
}

Outcome Control::commit_map(const std::string& name) {
  return impl_->run([&](v1::ControlCommand& command) {
    command.mutable_commit_map()->set_name(std::string(name));
  });
}

Outcome Control::name_version(std::int64_t version, const std::string& name) {
  return impl_->run([&](v1::ControlCommand& command) {
    command.mutable_name_version()->set_version(version);
    command.mutable_name_version()->set_name(std::string(name));
  });
}

Outcome Control::roll_back(std::int64_t version) {
  return impl_->run(
      [&](v1::ControlCommand& command) { command.mutable_roll_back()->set_version(version); });
}

Outcome Control::align_map(const std::vector<MeasuredTag>& measured) {
  return impl_->run([&](v1::ControlCommand& command) {
    command.mutable_align_map();
    for (const MeasuredTag& tag : measured) {
      auto& place = *command.mutable_align_map()->add_places();
      place.set_tag_id(static_cast<std::uint32_t>(tag.tag_id));
      for (const double part : tag.position_m) place.add_position(part);
    }
  });
}

Outcome Control::quarantine_tag(int tag_id) {
  return impl_->run([&](v1::ControlCommand& command) {
    command.mutable_quarantine_tag()->set_tag_id(static_cast<std::uint32_t>(tag_id));
  });
}

Outcome Control::forget_tag(int tag_id) {
  return impl_->run([&](v1::ControlCommand& command) {
    command.mutable_forget_tag()->set_tag_id(static_cast<std::uint32_t>(tag_id));
  });
}

Outcome Control::start_recording(const std::string& name) {
  return impl_->run([&](v1::ControlCommand& command) {
    command.mutable_start_recording()->set_name(std::string(name));
  });
}

Outcome Control::stop_recording() {
  return impl_->run([](v1::ControlCommand& command) { command.mutable_stop_recording(); });
}

}  // namespace fiducap
