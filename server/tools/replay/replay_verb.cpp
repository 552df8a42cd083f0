#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "detection/other_families.hpp"
#include "tools/replay/replay_verbs.hpp"
#include "tools/replay/run_plots.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

/// Progress, of the longest recording.
std::string replay_progress(const ReplayInputs& inputs, double data_s) {
  double length_s = 0;
  for (const ReplayInput& input : inputs.bodies)
    if (input.first < input.last)
      length_s = std::max(length_s, to_seconds(input.last - input.first));
  std::string text = "replaying " + inputs.bodies.front().info.name + ": " + fixed(data_s, 1);
  if (length_s > 0) text += " of " + fixed(std::max(length_s, data_s), 1);
  return text + " s of data";
}

void print_body(const Terminal& terminal, const std::string& name, const OfflineResult& result) {
  const OfflineStatistics& s = result.statistics;
  const double cpu =
      s.read_cpu_s + s.detect_cpu_s + s.propagate_cpu_s + s.update_cpu_s + s.resolve_cpu_s;
  terminal.out
      << fmt::format(
             "{}: {:.1f} s of data in {:.2f} s of CPU (read {:.2f}, detect {:.2f}, propagate "
             "{:.2f}, update {:.2f}, resolve {:.2f})\n",
             name, s.data_s, cpu, s.read_cpu_s, s.detect_cpu_s, s.propagate_cpu_s, s.update_cpu_s,
             s.resolve_cpu_s)
      << fmt::format(
             "  {} frames, {} with tags, {} of these with a pose; {} tags mapped, {} known\n",
             s.frames, s.frames_with_tags, s.frames_with_tags_and_pose, result.tags.size(),
             result.known.size())
      << fmt::format(
             "  reprojection median {:.2f} px, 95 % {:.2f} px; NIS per degree of freedom {:.2f}, "
             "{} of {} sightings rejected\n",
             s.reprojection_median_px, s.reprojection_p95_px, s.nis_per_dof(), s.tags_rejected,
             s.tags_rejected + s.tags_used);
  if (s.frames_before_anchoring > 0)
    terminal.out << "  the poses of " << s.frames_before_anchoring
                 << " images are left out: they are from before the body was anchored, in axes of "
                    "its own; --resolve places them\n";
  for (std::size_t k = 0; k < result.parts.size(); ++k) {
    const OfflinePart& part = result.parts[k];
    terminal.out << "  nothing ties " << part.trajectory.size() << " images";
    for (const KnownTag& tag : part.tags)
      terminal.out << (&tag == &part.tags.front() ? " with tags " : ", ") << tag.tag_id;
    terminal.out << " to the workspace: their poses are in " << part_name(name, k)
                 << ".tum, in axes of their own\n";
  }
  for (const std::string& doubt : result.doubts) terminal.out << "  warning: " << doubt << "\n";
}

void print_summary(const Terminal& terminal, const ReplayArguments& arguments,
                   const ReplayInputs& inputs, const OfflineSession& session) {
  for (std::size_t i = 0; i < inputs.bodies.size(); ++i)
    print_body(terminal, inputs.bodies[i].info.name, session.bodies[i]);
  if (session.turns_missed > 0)
    terminal.out
        << "  warning: " << session.turns_missed
        << " images could not be replayed in the order of the live session (samples are missing in "
           "the recording, or it began later): estimates differ from the live ones\n";
  if (const LiveAgreement& live = session.agreement; live.compared > 0) {
    terminal.out << "  " << live.compared - live.different << " of " << live.compared
                 << " live estimates repeated to the last bit";
    if (live.different > 0)
      terminal.out << ", the others at most " << live.worst_m << " m and " << live.worst_rad
                   << " rad away";
    terminal.out << "\n";
  }
  if (!session.solved.last.is_at_rest)
    terminal.out << "  warning: the last solution did not converge: measurements contradict each "
                    "other, and its sigmas are too small\n";
  const ReplayInput& first = inputs.bodies.front();
  terminal.out << "  written to " << arguments.out << "; next: fiducap evaluate "
               << (std::filesystem::path(arguments.out) / (first.info.name + ".tum")).string()
               << " " << first.info.folder << "\n";
}

/// Most sightings are rejected, as with a wrong clock, lens or IMU; real recordings with a poor
/// calibration reach a third.
bool contradicts_itself(const OfflineStatistics& s) {
  constexpr int kEnough = 100;
  const int all = s.tags_rejected + s.tags_used;
  return all >= kEnough && s.tags_rejected > 0.6 * all;
}

/// Turns recorded corners by half a turn.
class TurnedCorners final : public SensorSource {
 public:
  explicit TurnedCorners(std::unique_ptr<SensorSource> source) : source_(std::move(source)) {}
  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    auto sample = source_->next(std::move(stop));
    if (sample && *sample)
      if (auto* corners = std::get_if<CornerFrame>(&**sample))
        for (TagSighting& tag : corners->tags)
          std::rotate(tag.corners_px.begin(), tag.corners_px.begin() + 2, tag.corners_px.end());
    return sample;
  }

 private:
  std::unique_ptr<SensorSource> source_;
};

/// Whether sightings contradict the rest because of the family of the tags, as a sentence: another
/// one is in the images, or the corners of all tags are turned by half a turn.
std::string family_doubt(const ReplayInput& input, const OfflineResult& result,
                         const OfflineMap& map) {
  const std::string& family = input.setup.tags.family;
  if (std::string other = other_family_in(result.few.images(), input.setup.tags); !other.empty())
    return other;
  auto turned = open_input(input.info, input.setup);
  if (!turned) return {};
  const std::string twin = half_turned_family(family);
  if (!twin.empty()) turned->setup.tags.family = twin;
  TurnedCorners source(std::move(turned->source));
  OfflineMap start;
  start.config = map.config;
  start.start = map.start;
  const auto again = run_together({{1, input.info.name, turned->setup, &source}}, start);
  if (!again || contradicts_itself(again->bodies.front().statistics) ||
      again->bodies.front().statistics.frames_with_pose <= result.statistics.frames_with_pose)
    return {};
  return "all tags are turned by half a turn against the map: with " +
         (twin.empty() ? "their corners turned" : "tags.family: " + twin) + " the sightings fit" +
         (twin.empty() ? "" : " (OpenCV prints AprilTags upside down)");
}

/// @return kExitFailed for a replay without poses, or with contradictory measurements
int judge(const Terminal& terminal, const ReplayInputs& inputs, const OfflineSession& session,
          bool anyway) {
  int exit_code = kExitOk;
  for (std::size_t i = 0; i < inputs.bodies.size(); ++i) {
    const OfflineStatistics& s = session.bodies[i].statistics;
    const std::string& folder = inputs.bodies[i].info.folder;
    const bool must_be_sound = !inputs.is_session && !anyway;
    const auto& events = session.bodies[i].events;
    // Disagreements of sensors and configuration; print_body has those of tags.
    for (const BodyEvent& event : events)
      if (!event.text.empty() && event.kind != BodyEvent::Kind::kDoubt)
        terminal.err << "fiducap: warning: " << inputs.bodies[i].info.name << ": " << event.text
                     << "\n";
    const bool has_bad_imu =
        std::ranges::find(events, BodyEvent::Kind::kImuUnusable, &BodyEvent::kind) != events.end();
    if (must_be_sound && has_bad_imu) exit_code = kExitFailed;
    if (must_be_sound && contradicts_itself(s)) {
      const std::string doubt = family_doubt(inputs.bodies[i], session.bodies[i], inputs.map);
      exit_code =
          report(terminal, {ErrorCode::kInvalid,
                            "most sightings of tags contradict the rest: " +
                                (doubt.empty() ? "clocks, lens, place of the camera or sizes of "
                                                 "the tags are wrong"
                                               : doubt),
                            folder});
    }
    if (s.frames == 0)
      exit_code =
          report(terminal, {ErrorCode::kNotFound, "has neither images nor detections", folder});
    else if (s.frames_with_pose == 0)
      exit_code = report(
          terminal,
          {ErrorCode::kNotFound, no_pose_text(session.bodies[i], inputs.bodies[i].setup), folder});
  }
  return exit_code;
}

}  // namespace

int run_replay(const ReplayArguments& arguments, const Terminal& terminal) {
  auto inputs = read_replay_inputs(arguments);
  if (!inputs) return report(terminal, inputs.error());
  if (auto usable = check_replay_inputs(arguments, *inputs, terminal); !usable)
    return report(terminal, usable.error());
  if (auto free = check_run_folder(arguments.out); !free) return report(terminal, free.error());
  std::vector<OfflineBody> bodies;
  std::vector<RunBody> written;
  for (const ReplayInput& input : inputs->bodies) {
    bodies.push_back(
        {static_cast<int>(bodies.size()) + 1, input.info.name, input.setup, input.source.get()});
    written.push_back({input.info.name, input.info.folder});
  }
  const auto session = [&] {
    ProgressLine line(terminal);
    return run_together(bodies, inputs->map, [&](const OfflineProgress& at) {
      line.show(replay_progress(*inputs, at.data_s));
    });
  }();
  if (!session) return report(terminal, session.error());
  for (std::size_t i = 0; i < written.size(); ++i) {
    written[i].setup = &inputs->bodies[i].setup;
    written[i].result = &session->bodies[i];
  }
  const std::string plots = arguments.plots ? to_html(run_plots(written, *session)) : "";
  if (auto done = write_run_files(arguments.out, written, *session, plots); !done)
    return report(terminal, done.error());
  if (arguments.json)
    terminal.out << run_report(written, *session);
  else
    print_summary(terminal, arguments, *inputs, *session);
  return judge(terminal, *inputs, *session, arguments.anyway);
}

void add_replay(CLI::App& app, ChosenVerb& chosen) {
  auto* verb = app.add_subcommand(
      "replay", "Run a recording through the filter, offline, as fast as the machine allows");
  auto& a = arguments_of<ReplayArguments>(*verb, chosen, run_replay);
  verb->add_option("RECORDING", a.recordings,
                   "Folders in the EuRoC/ASL layout (mav0/cam0, mav0/imu0, mav0/tags0 …), or one "
                   "session of fiducapd")
      ->required();
  verb->add_option("--out", a.out,
                   "Folder for <recording>.tum and .covariance.csv, map.csv, extrinsics.yaml, "
                   "events.csv, report.json and plots.html; an earlier run in it is replaced")
      ->required();
  verb->add_flag("--together", a.together,
                 "Several recordings as several robots, in order of time, over one live map");
  verb->add_option(
      "--config", a.config,
      "Take the sections estimator, detector, tags and map.reference_* of a server configuration");
  verb->add_option("--map", a.map, "Tags whose places are known: .yaml, .csv");
  verb->add_option(
      "--store", a.store,
      "The newest version in this map store is the map at the start. With --resolve it must not "
      "have been made of these recordings: their sightings would count twice");
  verb->add_flag(
      "--resolve", a.resolve,
      "Solve for all poses and tags together after the last image: each pose by what was seen "
      "before and after it, with its covariance. One recording without an IMU is always resolved");
  add_filter_option(*verb, a.filter);
  add_set_option(*verb, a.sets);
  verb->add_flag("--anyway", a.anyway, "Run also what `fiducap check` calls unusable");
  verb->add_flag_callback(
      "--no-plots", [&a] { a.plots = false; }, "Leave plots.html out");
  verb->add_flag("--json", a.json, "Print report.json instead of words");
  verb->footer(
      "Example:\n"
      "  fiducap replay recordings/hall --out results --set estimator.corner_noise_px=0.3\n"
      "  fiducap evaluate results/hall.tum recordings/hall\n"
      "  fiducap replay drone rover arm --together --out results\n"
      "  fiducap replay recordings/hall --resolve --out results");
}

}  // namespace fiducap
