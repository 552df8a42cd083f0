#include "simulation/estimation_data.hpp"

#include <algorithm>
#include <map>

#include "base/pose.hpp"
#include "capture/sample_merger.hpp"
#include "daemon/system.hpp"
#include "support/results.hpp"

namespace fiducap {

namespace {

/// Between two true states: cubic in position (by both velocities) and in attitude (by both rates,
/// B axes).
TruthSample between(const TruthSample& a, const TruthSample& b, const Eigen::Vector3d& w_a,
                    const Eigen::Vector3d& w_b, Instant at) {
  const double h = to_seconds(b.at - a.at);
  const double s = to_seconds(at - a.at) / h;
  // Hermite's cubic from zero: its end value and both slopes times h.
  const double end = s * s * (3 - 2 * s);
  const double slope_a = s * (1 - s) * (1 - s);
  const double slope_b = -s * s * (1 - s);
  const auto cubic = [&](const Eigen::Vector3d& to, const Eigen::Vector3d& da,
                         const Eigen::Vector3d& db) {
    return Eigen::Vector3d(end * to + slope_a * h * da + slope_b * h * db);
  };
  const auto mean = [&](const Eigen::Vector3d& x, const Eigen::Vector3d& y) {
    return Eigen::Vector3d((1 - s) * x + s * y);
  };
  TruthSample out;
  out.at = at;
  out.X_WB.p = a.X_WB.p + cubic(b.X_WB.p - a.X_WB.p, a.v_WB, b.v_WB);
  out.X_WB.q =
      (a.X_WB.q * exp_so3(cubic(log_so3(a.X_WB.q.conjugate() * b.X_WB.q), w_a, w_b))).normalized();
  out.v_WB = mean(a.v_WB, b.v_WB);
  out.bias_w = mean(a.bias_w, b.bias_w);
  out.bias_f = mean(a.bias_f, b.bias_f);
  return out;
}

/// The first state that is not before an instant.
auto state_from(const std::vector<TruthSample>& truth, Instant at) {
  return std::lower_bound(truth.begin(), truth.end(), at,
                          [](const TruthSample& t, Instant i) { return t.at < i; });
}

/// Adds the instants of the images to a truth that has only those of the IMU.
void add_image_times(EstimationData& data) {
  std::vector<TruthSample> added;
  for (const SensorSample& sample : data.samples) {
    const Instant at = time_of(sample);
    const auto after = state_from(data.truth, at);
    if (after == data.truth.begin() || after == data.truth.end() || after->at == at) continue;
    const auto before = after - 1;
    added.push_back(
        between(*before, *after, data.rate_at(before->at), data.rate_at(after->at), at));
  }
  data.truth.insert(data.truth.end(), added.begin(), added.end());
  std::sort(data.truth.begin(), data.truth.end(),
            [](const TruthSample& a, const TruthSample& b) { return a.at < b.at; });
}

}  // namespace

std::vector<SensorSample> merged(SensorSource& source, bool has_imu, Instant end,
                                 const std::function<SensorSample(const SensorSample&)>& make) {
  std::vector<SensorSample> out;
  SampleMerger merger(MergerConfig{.has_imu = has_imu});
  const auto drain = [&] {
    while (auto sample = merger.pop()) out.push_back(make ? make(*sample) : std::move(*sample));
  };
  for (;;) {
    auto sample = value_of(source.next({}));
    if (!sample || time_of(*sample) > end) break;
    merger.push(std::move(*sample));
    drain();
  }
  merger.finish();
  drain();
  return out;
}

int first_tag(const EstimationData& data) {
  std::optional<int> first;
  for_each_image(data, [&](const CornerFrame& image) {
    for (const TagSighting& seen : image.tags)
      if (!first && data.tag(seen.tag_id) != nullptr) first = seen.tag_id;
  });
  if (!first) throw std::runtime_error(data.name + " shows no tag");
  return *first;
}

bool shows(const CornerFrame& image, int tag_id) {
  return std::any_of(image.tags.begin(), image.tags.end(),
                     [&](const TagSighting& t) { return t.tag_id == tag_id; });
}

const TruthSample& EstimationData::truth_at(Instant at) const {
  const auto found = state_from(truth, at);
  FIDUCAP_ASSERT(found != truth.end() && found->at == at);
  return *found;
}

TruthSample EstimationData::truth_near(Instant at) const {
  const auto after = state_from(truth, at);
  if (after == truth.end()) return truth.back();
  if (after->at == at || after == truth.begin()) return *after;
  const auto before = after - 1;
  return between(*before, *after, rate_at(before->at), rate_at(after->at), at);
}

Eigen::Vector3d EstimationData::rate_at(Instant at) const {
  FIDUCAP_ASSERT(truth.size() >= 3);
  auto nearest = state_from(truth, at);
  if (nearest == truth.end() ||
      (nearest != truth.begin() && at - (nearest - 1)->at < nearest->at - at))
    --nearest;
  const TruthSample* here = &*nearest;
  here = std::clamp(here, truth.data() + 1, truth.data() + truth.size() - 2);
  const TruthSample* before = here - 1;
  const TruthSample* after = here + 1;
  // Second order, although the steps differ: the mean rates of both steps belong to their middles.
  const double h1 = to_seconds(here->at - before->at);
  const double h2 = to_seconds(after->at - here->at);
  const Eigen::Vector3d w1 = log_so3(before->X_WB.q.conjugate() * here->X_WB.q) / h1;
  const Eigen::Vector3d w2 = log_so3(here->X_WB.q.conjugate() * after->X_WB.q) / h2;
  return (h2 * w1 + h1 * w2) / (h1 + h2);
}

const RecordedTag* EstimationData::tag(int tag_id) const {
  const auto found = std::find_if(tags.begin(), tags.end(),
                                  [&](const RecordedTag& t) { return t.tag_id == tag_id; });
  return found == tags.end() ? nullptr : &*found;
}

double EstimationData::path_m(Instant at) const {
  double length = 0;
  for (std::size_t i = 1; i < truth.size() && truth[i].at <= at; ++i)
    length += (truth[i].X_WB.p - truth[i - 1].X_WB.p).norm();
  return length;
}

int most_seen_tag(const EstimationData& data) {
  std::map<int, int> count;
  for_each_image(data, [&](const CornerFrame& image) {
    for (const TagSighting& tag : image.tags)
      if (tag.tag_id != data.reference_tag) ++count[tag.tag_id];
  });
  const auto most = std::max_element(
      count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == count.end() ? -1 : most->first;
}

Expected<EstimationData> load_estimation_data(const std::string& folder) {
  const auto info = read_recording_info(folder);
  if (!info) return tl::unexpected(info.error());
  auto truth = read_truth(folder);
  if (!truth) return tl::unexpected(truth.error());
  auto tags = read_truth_tags(folder);
  if (!tags) return tl::unexpected(tags.error());
  const auto extrinsics = read_truth_extrinsics(folder);
  if (!extrinsics) return tl::unexpected(extrinsics.error());
  if (truth->empty() || tags->empty() || extrinsics->size() != 1 || info->cameras.size() != 1 ||
      !info->imu) {
    return fail(ErrorCode::kInvalid,
                "needs one camera, an IMU and the truth of body, tags and extrinsics", folder);
  }
  const SystemClock clock;
  auto source = open_recording(*info, {}, clock);
  if (!source) return tl::unexpected(source.error());

  EstimationData data;
  data.name = info->name;
  data.samples = merged(**source, true, Instant::max());
  data.truth = std::move(*truth);
  data.tags = std::move(*tags);
  std::sort(data.tags.begin(), data.tags.end(),
            [](const RecordedTag& a, const RecordedTag& b) { return a.tag_id < b.tag_id; });
  data.tag_set.family = info->tag_family;
  for (const RecordedTag& tag : data.tags) data.tag_set.sizes_m[tag.tag_id] = tag.edge_m;
  data.camera = info->cameras.front();
  data.nominal_X_BV = data.camera.X_BV;
  data.camera.X_BV = extrinsics->front();
  data.imu = info->imu;
  add_image_times(data);
  data.reference_tag = info->reference_tag ? *info->reference_tag : first_tag(data);
  return data;
}

}  // namespace fiducap
