#include "streaming/dds/map_topics.hpp"

#include <algorithm>
#include <chrono>

#include "streaming/dds/ros_types.hpp"

namespace fiducap::dds {

namespace {

constexpr Duration kQuietTime = std::chrono::seconds(1);

bool is_settled(const MapTag& tag) {
  return tag.component == 0 &&
         (tag.state == TagState::kCalibrated || tag.state == TagState::kSurveyed);
}

bool has(const TagMap& map, int id) { return map.find(id) != nullptr; }

}  // namespace

MapTopics::MapTopics(TopicMaker& make) : world_frame_(make.config().world_frame) {
  const DdsConfig& config = make.config();
  tf_static_ =
      make.make(config.tf, ros_topic("/tf_static", RosType::kTfMessage), TopicMaker::kept());
  tags_ = make.make(config.native, {"fiducap/tags", &fiducap_dds_Tag_desc, {}}, TopicMaker::kept());
}

void MapTopics::publish(const SceneFrame& frame) {
  if (frame.map == told_ || !frame.map) return;
  if (told_at_ && frame.at - *told_at_ < kQuietTime) return;
  if (tf_static_) publish_tf(frame);
  if (tags_) publish_tags(*frame.map);
  told_ = frame.map;
  told_at_ = frame.at;
}

void MapTopics::publish_tf(const SceneFrame& frame) {
  std::vector<std::pair<int, Pose>> settled;
  std::vector<std::string> names;
  for (const auto& tag : frame.map->tags) {
    if (!is_settled(tag)) continue;
    settled.emplace_back(tag.tag.tag_id, tag.tag.X_WT);
    names.push_back("tag_" + std::to_string(tag.tag.tag_id));
  }
  const auto same = [](const auto& a, const auto& b) {
    return a.first == b.first && a.second.p == b.second.p &&
           a.second.q.coeffs() == b.second.q.coeffs();
  };
  // tf2 knows no way to take a frame back: fewer of them are no news.
  if (settled.empty() ||
      std::equal(settled.begin(), settled.end(), told_tf_.begin(), told_tf_.end(), same)) {
    return;
  }
  const std_msgs_msg_dds__Header_ header{to_ros(frame.utc_ns()), borrowed(world_frame_)};
  std::vector<geometry_msgs_msg_dds__TransformStamped_> transforms;
  for (std::size_t i = 0; i < settled.size(); ++i) {
    transforms.push_back({header, borrowed(names[i]), to_ros_transform(settled[i].second)});
  }
  tf2_msgs_msg_dds__TFMessage_ message{};
  message.transforms._length = message.transforms._maximum =
      static_cast<std::uint32_t>(transforms.size());
  message.transforms._buffer = transforms.data();
  send(tf_static_, &message);
  told_tf_ = std::move(settled);
}

void MapTopics::publish_tags(const TagMap& map) {
  fiducap_dds_Tag message{};
  for (const int id : told_ids_) {
    if (has(map, id)) continue;
    message.id = id;
    tags_->dispose(&message);
  }
  told_ids_.clear();
  for (const auto& tag : map.tags) {
    fill(message, tag, map.version);
    tags_->write(&message);
    told_ids_.push_back(tag.tag.tag_id);
  }
  tags_->flush();
}

void MapTopics::each(const std::function<void(const Writer&)>& visit) const {
  for (const auto* writer : {&tf_static_, &tags_}) {
    if (*writer) visit(**writer);
  }
}

}  // namespace fiducap::dds
