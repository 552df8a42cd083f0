#include "paper/paper_run.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/pose.hpp"

namespace fiducap::bench {

namespace {

PaperRun::At moment_of(const FilterMoment& m, const EstimationData& data) {
  PaperRun::At at;
  at.t_s = m.t_s;
  at.X_WB = m.estimate.X_WB;
  at.X_WB_true = m.X_WR * m.truth.X_WB;
  at.v_B = m.estimate.X_WB.q.conjugate() * m.estimate.v_WB;
  at.v_B_true = m.truth.X_WB.q.conjugate() * m.truth.v_WB;
  at.w_B = m.estimate.w_WB_B;
  at.w_B_true = data.rate_at(m.truth.at);
  at.X_BV = m.filter.extrinsics().front().X_BV;
  at.tags = static_cast<int>(m.corners.tags.size());
  std::vector<TagBelief> beliefs;
  m.filter.tag_beliefs(beliefs);
  for (const TagBelief& belief : beliefs) at.X_WT.emplace_back(belief.tag.tag_id, belief.tag.X_WT);
  return at;
}

PaperRun run_one(const PaperOptions& options, SimulatedDataSetup setup, const std::string& filter,
                 std::uint64_t seed) {
  setup.seed = seed;
  setup.images_for = filter;
  PaperRun out;
  out.data = simulate(setup);
  out.data.corner_noise_px = options.estimator.corner_noise_px;
  FilterChoice choice;
  choice.filter = filter;
  choice.estimator = options.estimator;
  choice.watch = [&](const FilterMoment& m) { out.at.push_back(moment_of(m, out.data)); };
  out.run = run_filter(out.data, choice);
  return out;
}

}  // namespace

const Pose* PaperRun::At::tag(int tag_id) const {
  const auto found =
      std::find_if(X_WT.begin(), X_WT.end(), [&](const auto& t) { return t.first == tag_id; });
  return found == X_WT.end() ? nullptr : &found->second;
}

double PaperRun::share_without_tag() const {
  return 1 - static_cast<double>(run.frames_with_tags) / std::max(1, run.frames);
}

int PaperRun::tags_seen() const {
  std::set<int> ids;
  for_each_image(data, [&](const CornerFrame& image) {
    for (const TagSighting& tag : image.tags)
      if (data.tag(tag.tag_id) != nullptr) ids.insert(tag.tag_id);
  });
  return static_cast<int>(ids.size());
}

double PaperRun::position_by(const BoundRun& of) const {
  const double error = run.scored_after(kSettled_s).rms([](const auto& a) { return a.position_m; });
  return error / rms(of, time_of(data.samples.front()), &bound::BoundAt::position_m);
}

double PaperRun::extrinsics_position_m(const At& moment) const {
  return (moment.X_BV.p - data.camera.X_BV.p).norm();
}

double PaperRun::extrinsics_rotation_rad(const At& moment) const {
  return angle_between(moment.X_BV.q, data.camera.X_BV.q);
}

namespace {

/// Of the scatter that the corners of all runs had.
void add_bounds(const PaperOptions& options, std::size_t filter, PaperRuns& runs) {
  std::vector<std::vector<CornerError>> errors;
  for (const auto& seed : runs) errors.push_back(corner_errors(seed[filter].data));
  const CornerScatter corners = corner_scatter(errors);
  in_parallel(static_cast<int>(runs.size()), options.threads, [&](int job) {
    PaperRun& run = runs[static_cast<std::size_t>(job)][filter];
    run.corners = corners;
    run.white_bound = white_bound(run.data, {}, corners);
    run.bound = scatter_bound(run.data, {}, corners);
  });
}

}  // namespace

PaperRuns run_all(const PaperOptions& options, const SimulatedDataSetup& setup) {
  const auto filters = options.filters.size();
  PaperRuns runs(static_cast<std::size_t>(options.repeats()), std::vector<PaperRun>(filters));
  in_parallel(options.repeats() * static_cast<int>(filters), options.threads, [&](int job) {
    const auto index = static_cast<std::size_t>(job);
    const std::size_t seed = index / filters;
    const std::size_t filter = index % filters;
    runs[seed][filter] =
        run_one(options, setup, options.filters[filter], options.first_seed + seed);
  });
  for (std::size_t filter = 0; filter < filters; ++filter) add_bounds(options, filter, runs);
  return runs;
}

Spread spread(const PaperRuns& runs, std::size_t filter,
              const std::function<double(const PaperRun&)>& of) {
  Spread out;
  for (const auto& seed : runs) {
    const double value = of(seed[filter]);
    out.rms += value * value / static_cast<double>(runs.size());
    out.worst = std::isnan(value) ? value : std::max(out.worst, value);
  }
  out.rms = std::sqrt(out.rms);
  return out;
}

void add_figure(PaperResult& result, PaperFigure line, const PaperRuns& runs,
                const std::function<double(const PaperRun&)>& of) {
  for (std::size_t f = 0; f < runs.front().size(); ++f) line.ours.push_back(spread(runs, f, of));
  result.figures.push_back(std::move(line));
}

void add_consistency(PaperResult& result, const PaperRuns& runs) {
  add_figure(result, {"NIS per degree of freedom", "", "-", "-", {}, 3}, runs,
             [](const PaperRun& r) { return r.run.nis / static_cast<double>(r.run.nis_dof); });
  add_figure(
      result, {"pose NEES per degree of freedom", "", "-", "-", {}, 2}, runs,
      [](const PaperRun& r) {
        return r.run.scored_after(kSettled_s).mean([](const auto& at) { return at.nees.pose / 6; });
      });
  add_figure(result, {"position RMSE / bound", "", "-", "-", {}, 2}, runs,
             [](const PaperRun& r) { return r.position_by(r.bound); });
  add_figure(result, {"position RMSE / bound of white errors", "", "-", "-", {}, 2}, runs,
             [](const PaperRun& r) { return r.position_by(r.white_bound); });
  add_figure(result, {"tags in the map / seen", "", "-", "-", {}, 2}, runs, [](const PaperRun& r) {
    return static_cast<double>(r.run.tags_mapped) / r.tags_seen();
  });
  add_figure(result, {"corner scatter", "px", "-", "-", {}, 3}, runs,
             [](const PaperRun& r) { return r.corners.rms_px; });
  add_figure(result, {"corner scatter / detector's sigma", "", "-", "-", {}, 2}, runs,
             [](const PaperRun& r) { return r.corners.excess(); });
  add_figure(result, {"corner error, the same in the next image", "%", "-", "-", {}, 0}, runs,
             [](const PaperRun& r) { return 100 * r.corners.to_next; });
  add_figure(result, {"corner error, lasting part", "%", "-", "-", {}, 0}, runs,
             [](const PaperRun& r) { return 100 * r.corners.lasting_share; });
  add_figure(result, {"until 1/e of the lasting part is left", "s", "-", "-", {}, 2}, runs,
             [](const PaperRun& r) { return r.corners.fades_s; });
}

const char* color_of(const std::string& filter) {
  return filter == "world" ? "#1565c0" : "#e65100";
}

}  // namespace fiducap::bench
