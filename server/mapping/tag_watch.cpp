#include "mapping/tag_watch.hpp"

#include <algorithm>

namespace fiducap {

namespace {

// A body is judged by the tags that it has just found in their places, and by those that it
// contradicted not long ago and has not found in place since: once it is right again, it is
// believed again.
constexpr Duration kJustNow = std::chrono::seconds(2);
constexpr Duration kNotLongAgo = std::chrono::seconds(10);
constexpr std::size_t kFittingBesideOne = 2;
constexpr std::size_t kFittingPerContradicted = 3;
// Robots come by now and then: a word counts for so long, unless somebody finds the tag in place.
constexpr Duration kWordHolds = std::chrono::minutes(10);
// A filter takes half a second for each: who has gone astray contradicts the next tag meanwhile.
constexpr std::size_t kWordsToDecide = 3;

void forget_before(Instant since, std::map<int, Instant>& times) {
  std::erase_if(times, [&](const auto& entry) { return entry.second < since; });
}

}  // namespace

std::vector<TagSuspicion> TagWatch::hear(int body_id, Instant at, std::span<const int> fitting,
                                         std::span<const int> contradicted) {
  OfBody& body = bodies_[body_id];
  for (const int tag_id : fitting) {
    OfTag& tag = tags_[tag_id];
    body.fitted[tag_id] = at;
    if (fitting.size() > 1) body.contradicted.erase(tag_id);
    (fitting.size() > 1 ? tag.fitted_at : tag.fitted_alone_at) = at;
    if (fitting.size() > 1) tag.words.clear();
  }
  std::vector<TagSuspicion> gone;
  if (contradicted.empty()) return gone;
  for (const int tag_id : contradicted) body.contradicted[tag_id] = at;
  if (!is_believed(body, at)) {
    take_back_words_of(body_id);
    return gone;
  }
  for (const int tag_id : contradicted) tags_[tag_id].words.push_back({body_id, at});
  for (const int tag_id : contradicted) {
    if (auto suspicion = judge(tag_id, at)) gone.push_back(std::move(*suspicion));
  }
  return gone;
}

void TagWatch::forget(int tag_id) {
  tags_.erase(tag_id);
  for (auto& [body_id, body] : bodies_) body.fitted.erase(tag_id);
}

void TagWatch::take_back_words_of(int body_id) {
  for (auto& [tag_id, tag] : tags_)
    std::erase_if(tag.words, [&](const Word& word) { return word.body_id == body_id; });
}

bool TagWatch::is_believed(OfBody& body, Instant at) {
  forget_before(at - kJustNow, body.fitted);
  forget_before(at - kNotLongAgo, body.contradicted);
  const auto fits = static_cast<std::size_t>(
      std::count_if(body.fitted.begin(), body.fitted.end(),
                    [&](const auto& entry) { return !body.contradicted.contains(entry.first); }));
  const std::size_t contradicted = body.contradicted.size();
  return fits >= (contradicted > 1 ? kFittingPerContradicted * contradicted : kFittingBesideOne);
}

std::optional<TagSuspicion> TagWatch::judge(int tag_id, Instant at) {
  OfTag& tag = tags_[tag_id];
  std::erase_if(tag.words, [&](const Word& word) { return word.at < at - kWordHolds; });
  if (tag.words.size() < kWordsToDecide) return std::nullopt;
  TagSuspicion out{.tag_id = tag_id,
                   .fitted_at = tag.fitted_at ? tag.fitted_at : tag.fitted_alone_at,
                   .first_word_at = tag.words.front().at,
                   .at = at,
                   .by = {}};
  for (const Word& word : tag.words) out.by.insert(word.body_id);
  tag.words.clear();
  return out;
}

}  // namespace fiducap
