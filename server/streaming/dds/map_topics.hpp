#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "streaming/dds/ros_messages.hpp"
#include "streaming/dds/topic_set.hpp"

namespace fiducap::dds {

/// Where the settled tags are: `/tf_static` (frames `tag_<id>`) and `fiducap/tags`, both kept for
/// late joiners. Written when the map changes, at most once a second.
class MapTopics final {
 public:
  explicit MapTopics(TopicMaker& make);

  void publish(const SceneFrame& frame);
  void each(const std::function<void(const Writer&)>& visit) const;

 private:
  void publish_tf(const SceneFrame& frame);
  void publish_tags(const TagMap& map);

  std::string world_frame_;
  std::shared_ptr<const TagMap> told_;
  std::optional<Instant> told_at_;
  std::vector<std::pair<int, Pose>> told_tf_;  ///< On `/tf_static`.
  std::vector<int> told_ids_;                  ///< On `fiducap/tags`.
  std::optional<Writer> tf_static_;
  std::optional<Writer> tags_;
};

}  // namespace fiducap::dds
