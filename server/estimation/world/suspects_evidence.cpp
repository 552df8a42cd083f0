// What data have said of suspects when something else than an image has changed the state.
#include <algorithm>
#include <chrono>
#include <cmath>

#include "estimation/world/prior_exchange.hpp"
#include "estimation/world/suspects.hpp"

namespace fiducap::world {

std::vector<Suspects::Evidence> Suspects::evidence(const FilterState& state) const {
  std::vector<Evidence> out;
  for (const Suspect& one : all_) {
    const double information = std::max(0.0, information_of(state, one.column, one.tight_sigma));
    out.push_back({score(state, one), information, state.P()(one.column, one.column)});
  }
  return out;
}

/// Evidence that is lost on the way is lost from the value, too: a value that stayed would be many
/// sigmas of what is left.
void Suspects::keep_evidence(FilterState& state, std::span<const Evidence> before) const {
  auto P = state.P();
  Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& one = all_[i];
    if (one.is_parameter || state.suspicions[i].is_open || !(before[i].variance > 0)) continue;
    double& variance = P(one.column, one.column);
    variance = std::max(variance, before[i].variance);
    const double left = std::max(0.0, information_of(state, one.column, one.tight_sigma));
    const double share = before[i].information > 0 ? left / before[i].information : 0.0;
    const double kept = before[i].score * std::sqrt(std::min(1.0, share));
    error(one.column) = kept * variance * std::sqrt(left) - value(state, one);
  }
  state.add_error(error);
}

namespace {

// A graph of some thousand segments is so far behind at most.
constexpr Duration kJudgementHolds = std::chrono::seconds(10);

}  // namespace

bool Suspects::follow_map(FilterState& state, const KnownMap& map, int body_id) const {
  const bool is_new = open_by_map(state, map, body_id);
  if (!map.is_judged) return is_new;
  state.judged_until = state.time + kJudgementHolds;
  acquit(state, kSuspected_sigma);
  return is_new;
}

bool Suspects::open_by_map(FilterState& state, const KnownMap& map, int body_id) const {
  const auto is_wrong_lens = [&](const Suspect& one) {
    return std::any_of(map.wrong_lenses.begin(), map.wrong_lenses.end(), [&](const auto& lens) {
      return lens.body_id == body_id && lens.camera == one.camera && lens.kind == one.kind;
    });
  };
  const auto is_wrong_print = [&](int tag_id) {
    return std::find(map.wrong_prints.begin(), map.wrong_prints.end(), tag_id) !=
           map.wrong_prints.end();
  };
  for (const int tag_id : map.wrong_prints) {
    if (state.find(tag_id) >= 0 && state.sizes.find(tag_id) < 0) watch_print(state, tag_id);
  }
  bool is_new = false;
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& one = all_[i];
    bool is_wrong = false;
    if (one.camera >= 0) {
      is_wrong = is_wrong_lens(one);
    } else if (one.print < 0) {
      is_wrong = is_wrong_print(KnownMap::kAllPrints);
    } else {
      const int tag_id = state.sizes.watched[static_cast<std::size_t>(one.print)].tag_id;
      is_wrong = tag_id >= 0 && is_wrong_print(tag_id);
    }
    is_new |= is_wrong && open_anew(state, i);
  }
  return is_new;
}

/// What images said of it was said against other places of the tags.
bool Suspects::open_anew(FilterState& state, std::size_t suspect) const {
  const Suspect& one = all_[suspect];
  if (one.is_parameter || one.assumed_sigma > 0 || state.suspicions[suspect].is_open) return false;
  state.suspicions[suspect] = {.is_open = true};
  state.clear_column(one.column, one.open_sigma);
  return true;
}

bool Suspects::is_closed(const FilterState& state, std::size_t suspect) const {
  const Suspect& one = all_[suspect];
  const bool is_free =
      one.print >= 0 && state.sizes.watched[static_cast<std::size_t>(one.print)].tag_id < 0;
  const bool is_assumed = one.assumed_sigma > 0;  // that is no suspicion
  return !one.is_parameter && !is_assumed && !is_free && !state.suspicions[suspect].is_open;
}

void Suspects::acquit(FilterState& state, double from_sigma) const {
  Eigen::VectorXd error = Eigen::VectorXd::Zero(state.size());
  for (std::size_t i = 0; i < state.suspicions.size(); ++i) {
    const Suspect& one = all_[i];
    if (!is_closed(state, i) || std::abs(score(state, one)) < from_sigma) continue;
    error(one.column) = -value(state, one);
    state.clear_column(one.column, one.tight_sigma);
    state.suspicions[i] = {};
  }
  state.add_error(error);
}

}  // namespace fiducap::world
