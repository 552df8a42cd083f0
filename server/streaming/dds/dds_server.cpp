#include <chrono>
#include <cstdint>
#include <future>
#include <map>
#include <set>

#include "base/log.hpp"
#include "base/time.hpp"
#include "streaming/dds/dds.hpp"
#include "streaming/dds/topics.hpp"

namespace fiducap::dds {

namespace {

/// Subscribers by participant: DDS has no connections, only matching readers. Updated when the page
/// asks, at most a few times a second.
class Listeners final {
 public:
  explicit Listeners(const Clock& clock) : clock_(clock) {}

  /// Starts an update from all writers.
  void begin() {
    for (auto& [participant, listener] : by_participant_) listener.topics.clear();
  }

  void note(const Writer& writer) {
    if (!writer.has_readers()) return;
    for (const auto& participant : writer.reading_participants()) {
      auto [place, is_new] = by_participant_.try_emplace(participant);
      Listener& listener = place->second;
      if (is_new) listener.since = clock_.now();
      const std::string& topic = writer.topic();
      listener.topics.insert(topic.starts_with("rt/") ? topic.substr(2) : topic);  // as in ROS
      const Count now{writer.handle(), writer.written(), writer.refused()};
      Count& before = listener.before.try_emplace(topic, now).first->second;
      if (before.writer != now.writer) before = {now.writer, 0, 0};
      listener.sent += now.written - before.written;
      listener.refused += now.refused - before.refused;
      before = now;
    }
  }

  /// Removes participants that were not seen in this update.
  void append_to(std::vector<ClientStatus>& out) {
    for (auto at = by_participant_.begin(); at != by_participant_.end();) {
      const Listener& listener = at->second;
      if (listener.topics.empty()) {
        at = by_participant_.erase(at);
        continue;
      }
      std::string detail;
      for (const auto& topic : listener.topics) {
        if (detail.size() > 200) {
          detail += " …";
          break;
        }
        detail += (detail.empty() ? "" : " ") + topic;
      }
      out.push_back({"dds", "participant " + at->first, std::move(detail), listener.sent,
                     listener.refused, to_seconds(clock_.now() - listener.since)});
      ++at;
    }
  }

 private:
  /// A topic's writer at the last update. A new one, for another model, counts from zero.
  struct Count {
    std::int32_t writer{};
    std::uint64_t written{};
    std::uint64_t refused{};
  };
  struct Listener {
    Instant since{};
    std::set<std::string> topics;
    std::map<std::string, Count> before;
    std::uint64_t sent{};  ///< Messages since it came, of all topics.
    std::uint64_t refused{};
  };

  const Clock& clock_;
  std::map<std::string, Listener> by_participant_;
};

/// All topics in one membership of the domain, for the model in use.
class Presence final {
 public:
  Presence(std::shared_ptr<Participant> joined, const DdsConfig& config, const EventBoard* events)
      : participant_(std::move(joined)),
        aliases_(config.aliases),
        make_(*participant_, config),
        scene_(make_),
        map_(make_),
        health_(make_, events) {}

  [[nodiscard]] const Participant& participant() const { return *participant_; }
  /// @return the first topic of all models that could not be created
  [[nodiscard]] Expected<void> made() const { return make_.result(); }
  /// @return the first topic of these bodies that could not be created
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

  void each(const WriterVisitor& visit) const {
    for (const auto& body : bodies_) body.each(visit);
    scene_.each(visit);
    map_.each(visit);
    health_.each(visit);
  }

 private:
  std::shared_ptr<Participant> participant_;  ///< Outlives the topics.
  NameAliases aliases_;
  TopicMaker make_;
  SceneTopics scene_;
  MapTopics map_;
  HealthTopic health_;
  /// At the start: a vehicle keeps its topic when another body is disabled.
  std::optional<bool> alone_;
  std::vector<BodyTopics> bodies_;
  PoseJumps jumps_;
  std::vector<bool> usable_;
  std::vector<std::uint32_t> counts_;
};

class DdsServer final : public Streamer {
 public:
  DdsServer(const ProtocolContext& context, const DdsConfig& config)
      : Streamer("dds"),
        join_(context.join_dds),
        config_(config),
        clock_(context.clock),
        events_(context.events),
        listeners_(context.clock) {}

  Expected<void> join(std::shared_ptr<const SceneModel> model) {
    auto presence = enter(*model);
    if (!presence) return tl::unexpected(presence.error());
    use_presence(std::move(*presence), std::move(model));
    return {};
  }

  void publish(const std::shared_ptr<const SceneFrame>& frame) override {
    if (stopped_) return;
    if (!presence_) return rejoin(frame->model);
    if (presence_->participant().is_to_be_left()) return leave();
    if (frame->model->generation != model_->generation) {
      model_ = frame->model;
      if (const auto made = presence_->use(*model_); !made)
        log::warning("dds", made.error().text());
    }
    presence_->publish(*frame);
  }

  void append_clients(std::vector<ClientStatus>& out) const override {
    if (!presence_) return;
    listeners_.begin();
    presence_->each([this](const Writer& writer) { listeners_.note(writer); });
    listeners_.append_to(out);
  }

  /// Subscribers are notified at once.
  void stop() override {
    stopped_ = true;
    presence_.reset();
    if (leaving_.valid()) leaving_.wait();
    if (joining_.valid()) joining_.wait();
  }

 private:
  static constexpr Duration kAway = std::chrono::seconds(10);

  // Leaving and joining takes long: not on the I/O thread.

  void leave() {
    left_at_ = clock_.now();
    leaving_ =
        std::async(std::launch::async, [last = std::move(presence_)]() mutable { last.reset(); });
  }

  void rejoin(const std::shared_ptr<const SceneModel>& model) {
    const auto is_running = [](const auto& future) {
      return future.valid() && future.wait_for(Duration{}) != std::future_status::ready;
    };
    if (is_running(leaving_) || is_running(joining_)) return;
    if (joining_.valid()) return finish_joining(model);
    if (clock_.now() - left_at_ < kAway) return;
    joining_ = std::async(std::launch::async, [this, model] { return enter(*model); });
  }

  void finish_joining(const std::shared_ptr<const SceneModel>& model) {
    left_at_ = clock_.now();
    auto joined = joining_.get();
    if (!joined) return log::warning("dds", joined.error().text());
    // The bodies may have changed meanwhile.
    if (const auto made = (*joined)->use(*model); !made) log::warning("dds", made.error().text());
    use_presence(std::move(*joined), model);
  }

  /// From any thread.
  Expected<std::unique_ptr<Presence>> enter(const SceneModel& model) const {
    auto participant = join_();
    if (!participant) return tl::unexpected(participant.error());
    auto presence = std::make_unique<Presence>(std::move(*participant), config_, events_);
    if (auto made = presence->made(); !made) return tl::unexpected(made.error());
    if (auto made = presence->use(model); !made) return tl::unexpected(made.error());
    return presence;
  }

  void use_presence(std::unique_ptr<Presence> presence, std::shared_ptr<const SceneModel> model) {
    model_ = std::move(model);
    presence_ = std::move(presence);
    log::info("dds",
              "serves ROS 2 topics in domain " + std::to_string(presence_->participant().domain()));
  }

  JoinDomain join_;
  DdsConfig config_;
  const Clock& clock_;
  const EventBoard* events_;
  mutable Listeners listeners_;
  std::unique_ptr<Presence> presence_;  ///< nullptr: outside the domain for a while.
  std::future<void> leaving_;
  std::future<Expected<std::unique_ptr<Presence>>> joining_;
  Instant left_at_{};
  std::shared_ptr<const SceneModel> model_;
  bool stopped_{false};
};

}  // namespace

std::vector<ConfigError> DdsConfig::check() const {
  return Checker{"streaming.dds."}
      .require(prefix.empty() || is_ros_namespace(prefix), "prefix", '"' + prefix + '"',
               "must be empty or a ROS namespace, e.g. /fiducap")
      .require(is_ros_frame(world_frame), "world_frame", '"' + world_frame + '"',
               "must be a ROS frame, e.g. world or map")
      .require(poses_deadline_hz == 0 || (poses_deadline_hz >= 1 && poses_deadline_hz <= 1000),
               "poses_deadline_hz", poses_deadline_hz, "must be 0 or in [1, 1000]")
      .within("px4_rate_hz", px4_rate_hz, 1, 1000)
      .errors;
}

StartedStreamer serve(const ProtocolContext& context, const DdsConfig& config) {
  auto server = std::make_unique<DdsServer>(context, config);
  if (const auto joined = server->join(context.model); !joined)
    return tl::unexpected(joined.error());
  return server;
}

}  // namespace fiducap::dds
