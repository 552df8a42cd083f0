#include <array>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/numeric.hpp"
#include "base/whole_file.hpp"
#include "tools/replay/run_plots.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

struct EvaluateArguments {
  std::string tum;
  std::string recording;
  std::string plot;  ///< Page with plots, .html; empty: none.
  bool json{false};
};

std::string line(const char* label, const std::optional<PoseErrors>& errors, const char* what) {
  if (!errors) return {};
  if (errors->samples == 0) return label + std::string("nothing to compare\n");
  return fmt::format("{}{} ({} {})\n", label, text_of(*errors), errors->samples, what);
}

const char* name_of(Evaluation::Against against) {
  constexpr std::array kNames{"truth", "other_program", "nothing"};
  return kNames[static_cast<std::size_t>(against)];
}

nlohmann::ordered_json json_of(const std::optional<PoseErrors>& errors) {
  if (!errors) return nullptr;
  return {{"samples", errors->samples},
          {"position_rmse_m", errors->position_rmse_m},
          {"position_max_m", errors->position_max_m},
          {"orientation_rmse_deg", kDegreesPerRadian * errors->rotation_rmse_rad},
          {"orientation_max_deg", kDegreesPerRadian * errors->rotation_max_rad}};
}

nlohmann::ordered_json json_of(const ReprojectionSummary& r) {
  return {{"detections", r.detections},
          {"scored", r.scored},
          {"without_pose", r.without_pose},
          {"without_tag", r.without_tag},
          {"outside_camera", r.outside_camera},
          {"median_px", r.median_px},
          {"p95_px", r.p95_px},
          {"p95_of_all_px", r.p95_of_all_px ? nlohmann::ordered_json(*r.p95_of_all_px) : nullptr}};
}

std::string line(const char* label, const ReprojectionSummary& r) {
  return fmt::format(
      "{}median {:.3f} px, 95 % {:.3f} px, of all {} ({} of {} detections; {} without pose, {} "
      "with unmapped tag, {} outside the camera)\n",
      label, r.median_px, r.p95_px,
      r.p95_of_all_px ? fmt::format("{:.3f} px", *r.p95_of_all_px) : "not known", r.scored,
      r.detections, r.without_pose, r.without_tag, r.outside_camera);
}

std::string heading(const Evaluation& e) {
  std::string text = e.against == Evaluation::Against::kTruth
                         ? "Errors against the recording's truth"
                     : e.against == Evaluation::Against::kOtherProgram
                         ? "Agreement with another program's answer"
                         : "The recording has no truth and no reference";
  if (e.reference_tag)
    text += ", axes of tag " + std::to_string(*e.reference_tag) + ", nothing fitted";
  if (e.reference_replaced) text += " (the recording's reference tag is not in both maps)";
  return text + "\n";
}

Expected<std::vector<StampedCovariance>> covariances_beside(const std::string& tum) {
  const std::string path = std::filesystem::path(tum).replace_extension(".covariance.csv").string();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return std::vector<StampedCovariance>{};
  return read_whole_file(path).and_then(
      [&](const std::string& text) { return covariances_from_csv(text, path); });
}

Expected<void> write_plots(const EvaluateArguments& arguments, const RunResults& run,
                           const Evaluation& evaluation, const Terminal& terminal) {
  const auto covariances = covariances_beside(arguments.tum);
  if (!covariances) return tl::unexpected(covariances.error());
  const std::filesystem::path tum(arguments.tum);
  const PlotPage page =
      evaluation_plots("Evaluation of " + tum.stem().string(), run, *covariances, evaluation);
  if (auto written = write_whole_file(arguments.plot, to_html(page)); !written) return written;
  if (!arguments.json) terminal.out << "  plots in       " << arguments.plot << "\n";
  return {};
}

std::string evaluation_text(const Evaluation& e) {
  const ReprojectionSummary& r = e.reprojection;
  std::string text = heading(e);
  text += line("  pose           ", e.pose, "poses, first 5 s left out");
  text += line("  levelled pose  ", e.levelled_pose, "poses; tag's place and heading only, z up");
  text += line("  pose in W      ", e.world_pose, "poses");
  text += line("  pose, fitted   ", e.fitted_pose,
               "poses, first 5 s left out; best rigid fit of the positions");
  text += line("  tag map        ", e.map, "tags");
  text += line("  map, fitted    ", e.fitted_map, "tags; best rigid fit, shape alone");
  text += line("  extrinsics     ", e.extrinsics, "cameras");
  text += line("  reprojection   ", r);
  if (e.truth_reprojection) text += line("  … of the other ", *e.truth_reprojection);
  text += fmt::format("  coverage       {:.2f} % ({} of {} frames with tags have a pose)",
                      100 * r.coverage(), r.frames_with_tags_and_pose, r.frames_with_tags);
  if (r.frames_with_tags_in_parts > 0)
    text +=
        fmt::format("; {:.2f} % with {} that are not connected to the rest, in axes of their own",
                    100 * r.coverage_with_parts(), r.frames_with_tags_in_parts);
  return text + "\n";
}

nlohmann::ordered_json evaluation_json(const Evaluation& e) {
  const ReprojectionSummary& r = e.reprojection;
  nlohmann::ordered_json json{{"against", name_of(e.against)},
                              {"reference_tag", nullptr},
                              {"reference_replaced", e.reference_replaced},
                              {"pose", json_of(e.pose)},
                              {"levelled_pose", json_of(e.levelled_pose)},
                              {"world_pose", json_of(e.world_pose)},
                              {"fitted_pose", json_of(e.fitted_pose)},
                              {"map", json_of(e.map)},
                              {"fitted_map", json_of(e.fitted_map)},
                              {"extrinsics", json_of(e.extrinsics)}};
  if (e.reference_tag) json["reference_tag"] = *e.reference_tag;
  json["reprojection"] = json_of(r);
  if (e.truth_reprojection) json["truth_reprojection"] = json_of(*e.truth_reprojection);
  json["coverage"] = {{"frames", r.frames},
                      {"frames_with_tags", r.frames_with_tags},
                      {"frames_with_tags_and_pose", r.frames_with_tags_and_pose},
                      {"frames_with_tags_in_parts", r.frames_with_tags_in_parts},
                      {"share", r.coverage()},
                      {"share_with_parts", r.coverage_with_parts()}};
  return json;
}

int run_evaluate(const EvaluateArguments& arguments, const Terminal& terminal) {
  if (!arguments.plot.empty() && !arguments.plot.ends_with(".html"))
    return report(terminal, {ErrorCode::kInvalid,
                             "--plot writes a page: its name must end in .html", arguments.plot});
  const auto info = read_recording_info(arguments.recording);
  if (!info) return report(terminal, info.error());
  const auto run = read_run(arguments.tum, info->cameras.size());
  if (!run) return report(terminal, run.error());
  const auto evaluation = [&] {
    ProgressLine progress(terminal);
    return evaluate(*run, arguments.recording, [&](double data_s) {
      progress.show("evaluating " + info->name + ": " + fixed(data_s, 1) + " s of data");
    });
  }();
  if (!evaluation) return report(terminal, evaluation.error());
  if (evaluation->reprojection.frames_with_tags_and_pose == 0 &&
      (!evaluation->pose || evaluation->pose->samples == 0))
    return report(terminal, {ErrorCode::kInvalid,
                             "no pose in it belongs to an image of this recording; is it empty, or "
                             "the run of another recording?",
                             arguments.tum});
  if (arguments.json)
    print_json(terminal, evaluation_json(*evaluation));
  else
    terminal.out << evaluation_text(*evaluation);
  if (!arguments.plot.empty())
    if (auto drawn = write_plots(arguments, *run, *evaluation, terminal); !drawn)
      return report(terminal, drawn.error());
  if (const auto mismatch = mismatch_of(*evaluation))
    return report(terminal, {ErrorCode::kInvalid, *mismatch, arguments.recording});
  return kExitOk;
}

}  // namespace

void add_evaluate(CLI::App& app, ChosenVerb& chosen) {
  auto* verb = app.add_subcommand("evaluate",
                                  "Errors of a replay against the recording's truth or reference");
  auto& a = arguments_of<EvaluateArguments>(*verb, chosen, run_evaluate);
  verb->add_option(
          "TUM", a.tum,
          "The replay's <recording>.tum; map.csv and extrinsics.yaml are read from beside it")
      ->required();
  verb->add_option("RECORDING", a.recording, "The recording it was made from")->required();
  verb->add_option("--plot", a.plot,
                   "Write a page with plots of errors, map and reprojection: .html");
  verb->add_flag("--json", a.json, "Numbers for scripts");
  verb->footer(
      "Poses are compared in the axes of the reference tag, nothing is fitted; where the truth has "
      "no tags, after a rigid fit of the positions. The first 5 s are left out.\n"
      "Example:\n  fiducap evaluate results/hall.tum recordings/hall --json\n"
      "  fiducap evaluate results/hall.tum recordings/hall --plot hall.html");
}

}  // namespace fiducap
