#include "daemon/server.hpp"

#include <algorithm>
#include <atomic>
#include <iostream>
#include <thread>
#include <utility>

#include <unistd.h>

#include "base/event_board.hpp"
#include "base/log.hpp"
#include "base/process.hpp"
#include "daemon/access_keeper.hpp"
#include "daemon/bodies/body_setup.hpp"
#include "daemon/bodies/body_worker.hpp"
#include "daemon/bodies/unseen_tags.hpp"
#include "daemon/map_keeper.hpp"
#include "daemon/map_start.hpp"
#include "daemon/operator_service.hpp"
#include "daemon/publisher.hpp"
#include "daemon/recording/session_recorder.hpp"
#include "daemon/setup/setup_session.hpp"
#include "daemon/stream_loop.hpp"
#include "daemon/system.hpp"
#include "daemon/views/camera_preview.hpp"
#include "daemon/watch/health_watch.hpp"
#include "middleware/participant.hpp"
#include "scene/scene.hpp"

namespace fiducap {
namespace {

template <typename Work>
std::jthread named(const char* name, Work work) {
  return std::jthread([name, work = std::move(work)](std::stop_token stop) {
    name_this_thread(name);
    work(std::move(stop));
  });
}

void stop_and_join(std::jthread& thread) {
  thread.request_stop();
  if (thread.joinable()) thread.join();
}

/// Shorter conditions are not worth a person's attention.
constexpr Duration kHold = std::chrono::seconds(1);
constexpr Duration kSourceTimeout = std::chrono::milliseconds(600);
constexpr Duration kMapTimeout = std::chrono::seconds(5);
constexpr Duration kAuditTimeout = std::chrono::milliseconds(500);
constexpr Duration kPollPeriod = std::chrono::milliseconds(5);
constexpr std::chrono::seconds kLastCommit{1};

ImageRemedies remedies_for(const BodyConfig& body) {
  switch (body.source.type) {
    case SourceType::kSimulator:
      return {"A simulated camera needs no repair: see the log, and restart the server"};
    case SourceType::kRecording:
      return {"See the log: can its files be read to their end?",
              "`fiducap replay` uses every image, however slow the computer"};
    case SourceType::kRos:
      return {"Is the topic published (`ros2 topic hz NAME`), and is its name right?"};
    case SourceType::kCamera:
      if (!is_file(body.source.camera))
        return {"Check its cable, its driver and `fiducap cameras`"};
      return {"See the log: can the video be read to its end?",
              "`fiducap import` and `fiducap replay` use every image of a video, however slow the "
              "computer; or take a smaller one"};
    case SourceType::kSensors:
      break;
  }
  return {"Check its cable, its driver and the name of its topic or device"};
}

Requester this_server() { return {"server", {}, "user " + std::to_string(::geteuid())}; }

}  // namespace

class Server::Impl final {
 public:
  Impl(const ServerConfig& config, const ServerOptions& options, const Clock& clock)
      : config_(config),
        options_(options),
        clock_(clock),
        access_(config.operators, events_, clock),
        membership_(config.dds, events_),
        opening_(config_, {options.motion, options.source}, clock, events_, membership_,
                 [this](std::size_t body) { scene_->source_lost(body); }),
        bodies_(clock),
        recorder_(config.recorder, clock, events_),
        second_looks_(
            [this](std::span<const SharedImage> images, std::stop_token stop) {
              return why_no_tag(images, config_.tags, config_.detector, std::move(stop));
            },
            clock) {}

  Expected<void> build();
  ServerEnd run();
  void stop() noexcept;
  [[nodiscard]] ProtocolPorts ports() const { return ports_; }
  [[nodiscard]] Instant simulation_start() const { return opening_.simulation_start(); }

 private:
  using Bodies = std::vector<BodyOpening::Body>;

  void build_scene(const Bodies& bodies);
  void build_workers(Bodies bodies);
  Expected<void> build_streaming();
  void start_threads();
  void show_setup_address() const;
  void give_up();
  ServerEnd shut_down();
  [[nodiscard]] bool map_is_stored();
  [[nodiscard]] bool is_audited();

  ServerConfig config_;
  ServerOptions options_;
  const Clock& clock_;
  EventBoard events_{utc_now_ns, kHold};
  AccessKeeper access_;
  dds::Membership membership_;
  BodyOpening opening_;
  std::optional<MapBuilder> map_;
  std::optional<Scene> scene_;
  std::optional<CameraPreview> views_;  ///< Only with a page that may show cameras.
  BodyThreads bodies_;
  std::optional<MapKeeper> keeper_;
  std::optional<RefinementLoop> refinement_;
  SessionRecorder recorder_;
  std::optional<OperatorService> operators_;
  StreamLoop frames_{"streaming"};
  StreamLoop pages_{"pages"};
  std::shared_ptr<SignalWait> signals_;
  ProtocolPorts ports_;
  std::optional<Publisher> publisher_;
  std::optional<HealthWatch> watch_;
  SecondLooks second_looks_;
  std::optional<SetupSession> setup_;
  std::atomic<bool> is_set_up_{false};
  std::jthread auditing_, paging_, viewing_, setting_up_, keeping_, refining_, recording_,
      publishing_, watching_, looking_;
};

Expected<void> Server::Impl::build() {
  if (config_.bodies.empty() && !options_.setup)
    return fail(ErrorCode::kInvalid, "bodies = []: must have at least one body");
  auto start = open_start_map(config_.map, config_.tags, events_);
  if (!start) return tl::unexpected(start.error());
  auto bodies = opening_.open_all(*start);
  if (!bodies) return tl::unexpected(bodies.error());
  log::info("mapping", "map version " + std::to_string(start->map.version) + " with " +
                           std::to_string(start->map.tags.size()) + " tags");
  if (config_.map.use_learned_extrinsics) {
    std::map<std::string, int> body_ids;
    for (const BodyConfig& body : config_.bodies) body_ids[body.name] = body.id;
    doubt_learned_lenses(start->learned, body_ids, start->map);
  }
  map_.emplace(config_.map.builder, std::move(start->map));
  refinement_.emplace(*map_, config_.map.builder.refine_period_s, clock_, events_,
                      [this](const RefinementTurn& turn) { recorder_.take_refinement(turn); });
  if (start->store)
    keeper_.emplace(std::move(*start->store), *map_, config_.map.builder.commit_period_s, clock_,
                    events_, [this] { return bodies_.learned(); });
  if (options_.setup)
    setup_.emplace(SetupSurroundings{options_.setup->file, options_.setup->offers_simulation,
                                     clock_, [this] { return membership_.join(); },
                                     [this] {
                                       is_set_up_ = true;
                                       stop();
                                     },
                                     access_});
  build_scene(*bodies);
  build_workers(std::move(*bodies));
  operators_.emplace(access_, *scene_, *map_, recorder_, events_, keeper_ ? &*keeper_ : nullptr);
  if (!config_.recorder.at_start.empty()) {
    const auto opened = recorder_.start_and_open(config_.recorder.at_start);
    // A failing disk is a lasting event; robots are tracked nevertheless.
    if (!opened && opened.error().code == ErrorCode::kInvalid) return opened;
  }
  return build_streaming();
}

void Server::Impl::build_scene(const Bodies& bodies) {
  RampConfig ramp;
  ramp.seconds = config_.map.correction_ramp_s;
  ramp.frame_s = std::max(ramp.frame_s, 1 / config_.streaming.rate_hz);
  std::vector<SceneBody> described;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const BodyConfig& config = config_.bodies[i];
    described.push_back({{config.id, config.name},
                         config.pivot,
                         config.limits,
                         bodies[i].setup.sensors,
                         config_.estimator,
                         ramp});
  }
  scene_.emplace(described);
}

void Server::Impl::build_workers(Bodies bodies) {
  if (web::shows_cameras(config_.streaming.web))
    views_.emplace(config_.tags, config_.detector, clock_);
  const SharedParts shared{*map_, *scene_, clock_, recorder_, events_};
  ServerConfig recorded = config_;
  recorded.operators = {};
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const BodyConfig& config = config_.bodies[i];
    const BodySensors& sensors = bodies[i].setup.sensors;
    // The motion of a controlled robot is known for the present only.
    auto truth = options_.motion ? SimulatedTruth{} : std::move(bodies[i].truth);
    recorder_.add_body(config.name, recording_of(sensors, config_.tags, config_.map.reference_tag),
                       std::move(truth));
    PipelineSetup setup = pipeline_setup(config_, config, bodies[i].setup);
    recorded.bodies[i].cameras.clear();  // replaced by the estimated ones
    for (std::size_t k = 0; k < sensors.cameras.size(); ++k) {
      const auto source = k < config.cameras.size() ? config.cameras[k].source : std::nullopt;
      recorded.bodies[i].cameras.push_back({.mount = sensors.cameras[k], .source = source});
    }
    auto views = views_ ? std::optional(views_->add(config.id, sensors)) : std::nullopt;
    bodies_.add(std::make_unique<BodyWorker>(
        BodyParts{
            i, config.id, config.name, std::move(setup), std::move(bodies[i].sources), {}, views},
        shared));
  }
  recorder_.set_surroundings({print_config(recorded), [this] { return map_->published(); }});
}

Expected<void> Server::Impl::build_streaming() {
  auto ports = start_protocols({frames_, pages_, config_, scene_->model(), *operators_, events_,
                                clock_, [this] { return membership_.join(); },
                                views_ ? &*views_ : nullptr, setup_ ? &*setup_ : nullptr});
  if (!ports) return tl::unexpected(ports.error());
  ports_ = *ports;
  frames_.on_delivered(
      [this](const std::shared_ptr<const SceneFrame>& frame) { watch_->delivered(frame); });
  publisher_.emplace(config_.streaming.rate_hz, *scene_, *map_, clock_,
                     [this](const std::shared_ptr<const SceneFrame>& frame) {
                       frames_.put(frame);
                       if (!pages_.hub().empty()) pages_.put(frame);
                     });
  watch_.emplace(events_, *publisher_, clock_, [this] { give_up(); });
  watch_->also([this] { membership_.look_at_cards(); });
  for (const auto& worker : bodies_.workers()) second_looks_.add(worker->unseen_tags());
  for (std::size_t i = 0; i < config_.bodies.size(); ++i)
    watch_->add(config_.bodies[i].id, config_.bodies[i].name, bodies_.workers()[i]->cameras(),
                remedies_for(config_.bodies[i]), bodies_.workers()[i]->pulse());
  return {};
}

void Server::Impl::start_threads() {
  auditing_ = named("access", [this](std::stop_token stop) { access_.run(stop); });
  bodies_.start([this] {
    log::info("daemon", "every source has ended");
    if (options_.exit_at_end) stop();
  });
  if (!pages_.hub().empty()) {
    paging_ = named("pages", [this](std::stop_token stop) {
      const std::stop_callback ended(stop, [this] { pages_.stop(); });
      pages_.run();
    });
  }
  if (views_) viewing_ = named("views", [this](std::stop_token stop) { views_->run(stop); });
  if (setup_) setting_up_ = named("set-up", [this](std::stop_token stop) { setup_->run(stop); });
  if (keeper_) keeping_ = named("map", [this](std::stop_token stop) { keeper_->run(stop); });
  refining_ = named("refine", [this](std::stop_token stop) { refinement_->run(stop); });
  recording_ = named("recorder", [this](std::stop_token stop) { recorder_.run(stop); });
  publishing_ = named("publisher", [this](std::stop_token stop) { publisher_->run(stop); });
  watching_ = named("watch", [this](std::stop_token stop) { watch_->run(stop); });
  looking_ = named("second look", [this](std::stop_token stop) { second_looks_.run(stop); });
}

ServerEnd Server::Impl::run() {
  if (options_.stop_on_signals) {
    signals_ = std::make_shared<SignalWait>(frames_.io(), [this] { stop(); });
    net::register_wait(frames_.io(), signals_);
    signals_->resume();
  }
  start_threads();
  const std::string what = setup_ ? "set-up of " + options_.setup->file
                                  : "serving " + std::to_string(config_.bodies.size()) + " bodies";
  access_.note(this_server(), "start: " + what, {});
  if (setup_ && ports_.web != 0) show_setup_address();
  log::info("daemon", what + (ports_.web == 0 || setup_
                                  ? ""
                                  : ", page on http://" + config_.streaming.web.address + ":" +
                                        std::to_string(ports_.web) + "/"));
  if (!set_realtime_priority())
    log::info("daemon",
              "real-time scheduling is not permitted: with all cores busy a frame may wait for a "
              "millisecond or two (LimitRTPRIO=10 in the unit fiducapd.service permits it)");
  frames_.run();
  return shut_down();
}

/// To the terminal only, since pages and services show the log.
void Server::Impl::show_setup_address() const {
  const std::string& address = config_.streaming.web.address;
  const bool is_any = address == "0.0.0.0" || address == "::";
  const bool is_v6 = !is_any && address.find(':') != std::string::npos;
  const std::string host = is_any ? "127.0.0.1" : is_v6 ? "[" + address + "]" : address;
  std::cout
      << "Open this address in a browser on this machine, with everything after #:\n\n  http://"
      << host << ":" << ports_.web << "/#" << setup_->secret() << "\n"
      << std::endl;
}

void Server::Impl::stop() noexcept {
  pages_.stop();
  frames_.stop();
}

/// On the watch's thread, since the I/O thread does not respond.
void Server::Impl::give_up() {
  if (!options_.give_up) return;
  if (keeper_) keeper_->request_commit();
  std::this_thread::sleep_for(kLastCommit);
  options_.give_up();
}

ServerEnd Server::Impl::shut_down() {
  refining_.request_stop();
  stop_and_join(watching_);
  looking_.request_stop();
  publishing_.request_stop();
  const bool all = bodies_.stop(kSourceTimeout);
  stop_and_join(setting_up_);
  publishing_.join();
  stop_and_join(paging_);
  const bool stored = map_is_stored();  // first: no recording is worth it
  if (signals_) signals_->release();
  recording_.request_stop();
  const bool recorded = recorder_.ends();
  if (recorded) recording_.join();
  bodies_.log_statistics();
  log::info("daemon", std::to_string(publisher_->frames()) + " frames published, " +
                          std::to_string(publisher_->missed()) + " ticks missed, " +
                          std::to_string(publisher_->frames() - watch_->delivered()) +
                          " frames replaced by a newer one before they were sent; stopped");
  access_.note(this_server(), "end", {});
  const bool audited = is_audited();
  if (!stored || !recorded) return ServerEnd::kLost;
  if (is_set_up_) return ServerEnd::kSetUp;
  return all && audited ? ServerEnd::kClean : ServerEnd::kLeftBehind;
}

bool Server::Impl::is_audited() {
  auditing_.request_stop();
  const Instant until = clock_.now() + kAuditTimeout;
  while (access_.is_running() && clock_.now() < until)
    static_cast<void>(clock_.wait_until(clock_.now() + kPollPeriod, {}));
  if (access_.is_running()) return false;
  auditing_.join();
  return true;
}

bool Server::Impl::map_is_stored() {
  if (!keeping_.joinable()) return true;
  keeping_.request_stop();
  const Instant until = clock_.now() + kMapTimeout;
  while (keeper_->is_running() && clock_.now() < until)
    static_cast<void>(clock_.wait_until(clock_.now() + kPollPeriod, {}));
  if (!keeper_->is_running()) {
    keeping_.join();
    return true;
  }
  events_.report({.severity = Severity::kError,
                  .subject = "map",
                  .kind = "lost",
                  .text = "the disk of the map is stuck: changes since the last stored version are "
                          "lost",
                  .remedy = "Check the disk of `map.store`"});
  return false;
}

Expected<std::unique_ptr<Server>> Server::build(const ServerConfig& config,
                                                const ServerOptions& options, const Clock& clock) {
  auto impl = std::make_unique<Impl>(config, options, clock);
  if (const auto built = impl->build(); !built) return tl::unexpected(built.error());
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() = default;
ServerEnd Server::run() { return impl_->run(); }
void Server::stop() { impl_->stop(); }
ProtocolPorts Server::ports() const { return impl_->ports(); }
Instant Server::simulation_start() const { return impl_->simulation_start(); }

}  // namespace fiducap
