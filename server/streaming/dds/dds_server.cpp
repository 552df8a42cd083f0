#include "streaming/dds/dds_server.hpp"

#include <chrono>
#include <functional>
#include <future>
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
  Offer(const Participant& in, const DdsConfig& config, const EventBoard* events)
      : aliases_(config.aliases),
        make_(in, config),
        scene_(make_),
        map_(make_),
        health_(make_, events) {}

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

/// All topics in one membership of the domain.
struct Presence {
  Presence(std::shared_ptr<Participant> joined, const DdsConfig& config, const EventBoard* events)
      : participant(std::move(joined)), offer(*participant, config, events) {}

  std::shared_ptr<Participant> participant;
  Offer offer;  // goes before the participant
};

class DdsServer final : public Streamer {
 public:
  DdsServer(JoinDomain join, const DdsConfig& config, const Clock& clock, const EventBoard* events)
      : join_(std::move(join)),
        config_(config),
        clock_(clock),
        events_(events),
        listeners_(clock) {}

  Expected<void> join(std::shared_ptr<const SceneModel> model) {
    auto presence = enter(*model);
    if (!presence) return tl::unexpected(presence.error());
    take_up(std::move(*presence), std::move(model));
    return {};
  }

  [[nodiscard]] std::string_view protocol() const override { return "dds"; }

  void publish(const std::shared_ptr<const SceneFrame>& frame) override {
    if (stopped_) return;
    if (!presence_) return come_back(frame->model);
    if (presence_->participant->is_crowded()) return leave();
    Offer& offer = presence_->offer;
    if (frame->model->generation != model_->generation) {
      model_ = frame->model;
      if (const auto made = offer.use(*model_); !made) log::warning("dds", made.error().text());
    }
    offer.publish(*frame);
  }

  void append_clients(std::vector<ClientStatus>& out) const override {
    if (!presence_) return;
    listeners_.begin();
    presence_->offer.each([this](const Writer& writer) { listeners_.look_at(writer); });
    listeners_.append_to(out);
  }

  /// Subscribers learn at once that nobody sends any more.
  void stop() override {
    stopped_ = true;
    presence_.reset();
    if (leaving_.valid()) leaving_.wait();
    if (joining_.valid()) joining_.wait();
  }

 private:
  static constexpr Duration kAway = std::chrono::seconds(10);

  // To leave and to join takes a while (names are looked up, hundreds of participants forgotten):
  // not on the I/O thread.

  void leave() {
    left_at_ = clock_.now();
    leaving_ =
        std::async(std::launch::async, [last = std::move(presence_)]() mutable { last.reset(); });
  }

  void come_back(const std::shared_ptr<const SceneModel>& model) {
    const auto is_going_on = [](const auto& future) {
      return future.valid() && future.wait_for(Duration{}) != std::future_status::ready;
    };
    if (is_going_on(leaving_) || is_going_on(joining_)) return;
    if (joining_.valid()) return finish_joining(model);
    if (clock_.now() - left_at_ < kAway) return;
    joining_ = std::async(std::launch::async, [this, model] { return enter(*model); });
  }

  void finish_joining(const std::shared_ptr<const SceneModel>& model) {
    left_at_ = clock_.now();
    auto joined = joining_.get();
    if (!joined) return log::warning("dds", joined.error().text());
    // The bodies may have changed meanwhile.
    if (const auto made = (*joined)->offer.use(*model); !made)
      log::warning("dds", made.error().text());
    take_up(std::move(*joined), model);
  }

  /// From any thread.
  Expected<std::unique_ptr<Presence>> enter(const SceneModel& model) const {
    auto participant = join_();
    if (!participant) return tl::unexpected(participant.error());
    auto presence = std::make_unique<Presence>(std::move(*participant), config_, events_);
    if (auto made = presence->offer.made(); !made) return tl::unexpected(made.error());
    if (auto made = presence->offer.use(model); !made) return tl::unexpected(made.error());
    return presence;
  }

  void take_up(std::unique_ptr<Presence> presence, std::shared_ptr<const SceneModel> model) {
    model_ = std::move(model);
    presence_ = std::move(presence);
    log::info("dds",
              "serves ROS 2 topics in domain " + std::to_string(presence_->participant->domain()));
  }

  JoinDomain join_;
  DdsConfig config_;
  const Clock& clock_;
  const EventBoard* events_;
  mutable Listeners listeners_;
  std::unique_ptr<Presence> presence_;  ///< Nothing: out of the domain for a while.
  std::future<void> leaving_;
  std::future<Expected<std::unique_ptr<Presence>>> joining_;
  Instant left_at_{};
  std::shared_ptr<const SceneModel> model_;
  bool stopped_{false};
};

}  // namespace

Expected<std::unique_ptr<Streamer>> start_dds_server(JoinDomain join, const DdsConfig& config,
                                                     std::shared_ptr<const SceneModel> model,
                                                     const Clock& clock, const EventBoard* events) {
  auto server = std::make_unique<DdsServer>(std::move(join), config, clock, events);
  if (const auto joined = server->join(std::move(model)); !joined)
    return tl::unexpected(joined.error());
  return server;
}

}  // namespace fiducap::dds
