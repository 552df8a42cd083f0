#include "streaming/native/control_codec.hpp"

#include <cmath>
#include <utility>

#include "fiducap/v1/control.pb.h"

namespace fiducap::native {

namespace {

// Rounding of a unit quaternion is within this.
constexpr double kUnitTolerance = 1e-3;
constexpr double kFarthestPivot_m = 1000;

Expected<Pose> to_pose(const v1::SetPivot& in) {
  if (in.position_size() != 3 || in.orientation_wxyz_size() != 4)
    return fail(ErrorCode::kInvalid, "a pivot needs 3 numbers of its place and 4 of its attitude");
  const Eigen::Vector3d p(in.position(0), in.position(1), in.position(2));
  const Eigen::Quaterniond q(in.orientation_wxyz(0), in.orientation_wxyz(1), in.orientation_wxyz(2),
                             in.orientation_wxyz(3));
  if (!(p.norm() <= kFarthestPivot_m))
    return fail(ErrorCode::kInvalid, "the pivot must be within 1000 m of its body");
  if (!(std::abs(q.norm() - 1.0) <= kUnitTolerance))
    return fail(ErrorCode::kInvalid, "the pivot's quaternion must have unit length");
  return Pose{q.normalized(), p};
}

void put(const OperatorApi::Body& body, v1::ControlBody& out) {
  out.set_id(static_cast<std::uint32_t>(body.id));
  out.set_name(body.name);
  out.set_enabled(body.enabled);
  for (int i = 0; i < 3; ++i) out.add_position(body.X_BP.p[i]);
  for (const double part : {body.X_BP.q.w(), body.X_BP.q.x(), body.X_BP.q.y(), body.X_BP.q.z()})
    out.add_orientation_wxyz(part);
}

void put(const RecordingStatus& recording, v1::ControlRecording& out) {
  out.set_name(recording.name);
  out.set_state(static_cast<v1::ControlRecording::State>(recording.state));
  out.set_reason(recording.reason);
  out.set_samples(recording.samples);
  out.set_bytes(recording.bytes);
  out.set_dropped(recording.dropped);
}

// 512 events of this length are below the clients' limit of a megabyte.
constexpr std::size_t kLongestText = 512;

void put(const Event& event, v1::ControlEvent& out) {
  out.set_number(event.number);
  out.set_utc_ms(static_cast<std::uint64_t>(event.utc_ms));
  out.set_severity(static_cast<v1::ControlEvent::Severity>(event.severity));
  out.set_subject(event.subject.substr(0, kLongestText));
  out.set_kind(event.kind.substr(0, kLongestText));
  out.set_text(event.text.substr(0, kLongestText));
  out.set_remedy(event.remedy.substr(0, kLongestText));
  out.set_over(event.over);
}

void append_length(std::vector<std::byte>& out, std::size_t size) {
  for (int i = 0; i < 4; ++i) out.push_back(static_cast<std::byte>(size >> (8 * i)));
}

/// @param change  with the OperatorApi, the client and the id of the body
template <typename Change>
Expected<ControlAction> of_body(std::uint32_t id, Change change) {
  if (id == 0 || id > 0x7fffffff) return fail(ErrorCode::kInvalid, "body_id must be 1 or more");
  return [body_id = static_cast<int>(id), change](OperatorApi& api, const Requester& by) {
    return change(api, by, body_id);
  };
}

ControlAction of_map(MapChange change) {
  return [change = std::move(change)](OperatorApi& api, const Requester& by) {
    return api.change_map(by, change);
  };
}

Expected<int> to_tag_id(std::uint32_t id) {
  if (id > 0x7fffffff)
    return fail(ErrorCode::kInvalid,
                "a tag's id must be below 2147483648, is " + std::to_string(id));
  return static_cast<int>(id);
}

template <typename Change>
Expected<ControlAction> of_tag(std::uint32_t id) {
  const auto tag_id = to_tag_id(id);
  if (!tag_id) return tl::unexpected(tag_id.error());
  return of_map(Change{*tag_id});
}

Expected<ControlAction> to_alignment(const v1::AlignMap& in) {
  AlignMap out;
  for (const v1::MeasuredPlace& place : in.places()) {
    const auto tag_id = to_tag_id(place.tag_id());
    if (!tag_id) return tl::unexpected(tag_id.error());
    if (place.position_size() != 3)
      return fail(ErrorCode::kInvalid, "the place of tag " + std::to_string(*tag_id) +
                                           " needs 3 numbers, has " +
                                           std::to_string(place.position_size()));
    out.places.push_back({*tag_id, {place.position(0), place.position(1), place.position(2)}});
  }
  return of_map(std::move(out));
}

}  // namespace

Expected<ControlRequest> decode_control_request(std::span<const std::byte> message) {
  v1::ControlRequest in;
  if (message.size() > kMaxControlMessage ||
      !in.ParseFromArray(message.data(), static_cast<int>(message.size()))) {
    return fail(ErrorCode::kTruncated,
                "expected a ControlRequest, got " + std::to_string(message.size()) + " bytes");
  }
  ControlRequest request{in.sequence(), in.proof(), in.body()};
  if (in.has_watch_events()) request.watch_after = in.watch_events().after();
  return request;
}

Expected<ControlAction> decode_control_command(const std::string& body) {
  google::protobuf::Arena arena;  // it has a oneof: see `envelope_in`
  auto& in = *google::protobuf::Arena::CreateMessage<v1::ControlCommand>(&arena);
  if (!in.ParseFromString(body)) return fail(ErrorCode::kTruncated, "expected a ControlCommand");
  switch (in.command_case()) {
    case v1::ControlCommand::kListBodies:
      return ControlAction{};
    case v1::ControlCommand::kSetEnabled:
      return of_body(
          in.set_enabled().body_id(),
          [enabled = in.set_enabled().enabled()](OperatorApi& api, const Requester& by, int id) {
            return api.set_enabled(by, id, enabled);
          });
    case v1::ControlCommand::kRename:
      return of_body(in.rename().body_id(),
                     [name = in.rename().name()](OperatorApi& api, const Requester& by, int id) {
                       return api.rename(by, id, name);
                     });
    case v1::ControlCommand::kSetPivot: {
      const auto X_BP = to_pose(in.set_pivot());
      if (!X_BP) return tl::unexpected(X_BP.error());
      return of_body(in.set_pivot().body_id(),
                     [X_BP = *X_BP](OperatorApi& api, const Requester& by, int id) {
                       return api.set_pivot(by, id, X_BP);
                     });
    }
    case v1::ControlCommand::kSetMapMode:
      return [mode = in.set_map_mode().mapping() ? MapMode::kMapping : MapMode::kFrozen](
                 OperatorApi& api, const Requester& by) { return api.set_map_mode(by, mode); };
    case v1::ControlCommand::kCommitMap:
      return of_map(CommitVersion{in.commit_map().name()});
    case v1::ControlCommand::kStartRecording:
      return [name = in.start_recording().name()](OperatorApi& api, const Requester& by) {
        return api.start_recording(by, name);
      };
    case v1::ControlCommand::kStopRecording:
      return [](OperatorApi& api, const Requester& by) { return api.stop_recording(by); };
    case v1::ControlCommand::kNameVersion:
      return of_map(NameVersion{in.name_version().version(), in.name_version().name()});
    case v1::ControlCommand::kRollBack:
      return of_map(RollBack{in.roll_back().version()});
    case v1::ControlCommand::kAlignMap:
      return to_alignment(in.align_map());
    case v1::ControlCommand::kQuarantineTag:
      return of_tag<QuarantineTag>(in.quarantine_tag().tag_id());
    case v1::ControlCommand::kForgetTag:
      return of_tag<ForgetTag>(in.forget_tag().tag_id());
    case v1::ControlCommand::COMMAND_NOT_SET:
      break;
  }
  return fail(ErrorCode::kUnsupported, "this server does not know the command");
}

void append(std::vector<std::byte>& out, const ControlReply& reply) {
  v1::ControlReply message;
  message.set_sequence(reply.sequence);
  message.set_result(static_cast<v1::ControlReply::Result>(reply.result));
  message.set_text(reply.text);
  if (!reply.challenge.empty()) message.mutable_hello()->set_challenge(reply.challenge);
  if (reply.state) {
    auto& state = *message.mutable_state();
    for (const auto& body : reply.state->bodies) put(body, *state.add_bodies());
    state.set_mapping(reply.state->map_mode == MapMode::kMapping);
    state.set_recording(reply.state->recording);
    state.set_map_version(reply.state->map_version);
    for (const auto& recording : reply.state->recordings) put(recording, *state.add_recordings());
  }
  const std::size_t size = message.ByteSizeLong();
  append_length(out, size);
  const std::size_t at = out.size();
  out.resize(at + size);
  FIDUCAP_ASSERT(message.SerializeToArray(out.data() + at, static_cast<int>(size)));
}

std::string encode_events(std::span<const std::shared_ptr<const Event>> happened,
                          std::span<const std::shared_ptr<const Event>> standing) {
  v1::ControlReply message;
  auto& events = *message.mutable_events();
  for (const auto& event : happened) put(*event, *events.add_happened());
  for (const auto& event : standing) put(*event, *events.add_standing());
  return message.SerializeAsString();
}

void append(std::vector<std::byte>& out, std::uint64_t sequence, std::string_view encoded_events) {
  v1::ControlReply own;
  own.set_sequence(sequence);
  const std::string head = own.SerializeAsString();
  append_length(out, head.size() + encoded_events.size());
  // Protobuf: concatenated messages of one type are one with the fields of both.
  for (const std::string_view part : {std::string_view(head), encoded_events}) {
    const auto bytes = std::as_bytes(std::span(part));
    out.insert(out.end(), bytes.begin(), bytes.end());
  }
}

}  // namespace fiducap::native
