#include "streaming/dds/dds_server.hpp"

#include <functional>
#include <optional>
#include <utility>

#include "base/log.hpp"
#include "streaming/conventions/pose_jumps.hpp"
#include "streaming/dds/body_topics.hpp"
#include "streaming/dds/health_topic.hpp"
#include "streaming/dds/listeners.hpp"
#include "streaming/dds/map_topics.hpp"
#include "streaming/dds/ros_names.hpp"
#include "streaming/dds/scene_topics.hpp"

namespace fiducap::dds {

namespace {

/// All topics, for the model in use.
class Offer final {
 public:
  Offer(const Participant& in, const DdsConfig& config)
      : aliases_(config.aliases), make_(in, config), scene_(make_), map_(make_), health_(make_) {}

  /// @return the topics that every model has could all be made
  [[nodiscard]] Expected<void> made() const { return make_.result(); }
  /// @return the first topic of these bodies that could not be made
  Expected<void> use(const SceneModel& model) {
    const auto names = ros_names(model, aliases_);
    if (!alone_) alone_ = names.size() == 1;
    make_.begin();
    bodies_.clear();
    bodies_.reserve(names.size());
    for (const auto& name : names) bodies_.emplace_back(make_, name, *alone_);
    scene_.use(model, names);
    health_.use(model);
    return make_.result();
  }

  void publish(const SceneFrame& frame) {
    if (bodies_.size() != frame.bodies.size()) return;
    jumps_.observe(frame);
    usable_.resize(bodies_.size());
    counts_.resize(bodies_.size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      usable_[i] = is_usable(frame.bodies[i]);
      counts_[i] = jumps_.count(i);
      if (usable_[i]) bodies_[i].publish(frame, frame.bodies[i], counts_[i]);
    }
    scene_.publish(frame, usable_, counts_);
    health_.publish(frame);
    map_.publish(frame);
  }

  void each(const std::function<void(const Writer&)>& visit) const {
    for (const auto& body : bodies_) body.each(visit);
    scene_.each(visit);
    map_.each(visit);
    health_.each(visit);
  }

 private:
  NameAliases aliases_;
  TopicMaker make_;
  SceneTopics scene_;
  MapTopics map_;
  HealthTopic health_;
  /// As of the start: a vehicle keeps its topic when another body is switched off.
  std::optional<bool> alone_;
  std::vector<BodyTopics> bodies_;
  PoseJumps jumps_;
  std::vector<bool> usable_;
  std::vector<std::uint32_t> counts_;
};

class DdsServer final : public Streamer {
 public:
  DdsServer(std::shared_ptr<Participant> participant, const DdsConfig& config, const Clock& clock)
      : participant_(std::move(participant)), config_(config), listeners_(clock) {
    offer_.emplace(*participant_, config_);
  }

  [[nodiscard]] Expected<void> made() const { return offer_->made(); }
  Expected<void> use(std::shared_ptr<const SceneModel> model) {
    model_ = std::move(model);
    return offer_->use(*model_);
  }

  [[nodiscard]] std::string_view protocol() const override { return "dds"; }

  void publish(const std::shared_ptr<const SceneFrame>& frame) override {
    if (!offer_) return;
    if (frame->model->generation != model_->generation) {
      if (const auto made = use(frame->model); !made) log::warning("dds", made.error().text());
    }
    offer_->publish(*frame);
  }

  void append_clients(std::vector<ClientStatus>& out) const override {
    if (!offer_) return;
    listeners_.begin();
    offer_->each([this](const Writer& writer) { listeners_.look_at(writer); });
    listeners_.append_to(out);
  }

  /// Subscribers learn at once that nobody sends any more.
  void stop() override {
    offer_.reset();
    participant_.reset();
  }

 private:
  std::shared_ptr<Participant> participant_;
  DdsConfig config_;
  mutable Listeners listeners_;
  std::optional<Offer> offer_;  // goes before the participant
  std::shared_ptr<const SceneModel> model_;
};

}  // namespace

Expected<std::unique_ptr<Streamer>> start_dds_server(std::shared_ptr<Participant> participant,
                                                     const DdsConfig& config,
                                                     std::shared_ptr<const SceneModel> model,
                                                     const Clock& clock) {
  const int domain = participant->domain();
  auto server = std::make_unique<DdsServer>(std::move(participant), config, clock);
  if (const auto made = server->made(); !made) return tl::unexpected(made.error());
  if (const auto made = server->use(std::move(model)); !made) return tl::unexpected(made.error());
  log::info("dds", "serves ROS 2 topics in domain " + std::to_string(domain));
  return server;
}

}  // namespace fiducap::dds
