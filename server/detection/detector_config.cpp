#include "detection/detector_config.hpp"

#include "capture/recording/recording.hpp"
#include "detection/tag_family.hpp"

namespace fiducap {

static constexpr double kSurelyMillimetres = 5;  // no printer makes tags of 5 m

std::vector<ConfigError> TagSetConfig::check() const {
  Checker checker{"tags."};
  checker.require(is_tag_family(family), "family", family, tag_family_rule(family))
      .positive("size_m", size_m)
      .require(!(size_m >= kSurelyMillimetres), "size_m", size_m,
               "must be in metres: 160 mm is 0.16")
      .within("max_hamming", max_hamming, 0, 3);
  for (const auto& [id, size] : sizes_m) {
    const std::string field = "sizes_m." + std::to_string(id);
    checker.positive(field, size)
        .require(!(size >= kSurelyMillimetres), field, size, "must be in metres: 160 mm is 0.16");
  }
  return checker.errors;
}

TagSetConfig tags_of(const RecordingInfo& recording) {
  TagSetConfig tags{listed_tag_family(recording.tag_family), recording.tag_size_m,
                    recording.tag_sizes_m, recording.ignore_tags};
  if (recording.max_hamming) tags.max_hamming = *recording.max_hamming;
  return tags;
}

std::vector<ConfigError> DetectorConfig::check() const {
  return Checker{"detector."}
      .within("decimate", decimate, 1, 8)
      .within("blur_sigma_px", blur_sigma_px, 0, 5)
      .within("max_hamming", max_hamming, 0, 2)
      .within("min_decision_margin", min_decision_margin, 0, 255)
      .within("min_white_black_diff", min_white_black_diff, 1, 100)
      .within("search_period_s", search_period_s, 0.01, 60)
      .within("threads", threads, 1, 16)
      .errors;
}

}  // namespace fiducap
