#include "tools/usable_recording.hpp"

#include "pipeline/replay/recording_check.hpp"

namespace fiducap {

Expected<void> require_usable(const RecordingInfo& info, const Terminal& terminal) {
  const auto checked = check_recording(info);
  if (!checked) return tl::unexpected(checked.error());
  for (std::size_t i = checked->is_usable() ? 0 : 1; i < checked->findings.size(); ++i) {
    const RecordingFinding& finding = checked->findings[i];
    terminal.err << "fiducap: " << (finding.unusable ? "" : "warning: ") << info.folder << ": "
                 << finding.text << "\n";
  }
  if (checked->is_usable()) return {};
  return fail(ErrorCode::kInvalid, checked->findings.front().text, info.folder);
}

}  // namespace fiducap
