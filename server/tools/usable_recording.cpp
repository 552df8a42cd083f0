#include "tools/usable_recording.hpp"

namespace fiducap {

Expected<RecordingReport> require_usable(const RecordingInfo& info, const Terminal& terminal) {
  auto checked = check_recording(info);
  if (!checked) return tl::unexpected(checked.error());
  for (std::size_t i = checked->is_usable() ? 0 : 1; i < checked->findings.size(); ++i) {
    const RecordingFinding& finding = checked->findings[i];
    terminal.err << "fiducap: " << (finding.unusable ? "" : "warning: ") << info.folder << ": "
                 << finding.text << "\n";
  }
  if (checked->is_usable()) return std::move(*checked);
  return fail(ErrorCode::kInvalid, checked->findings.front().text, info.folder);
}

}  // namespace fiducap
