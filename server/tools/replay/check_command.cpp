#include "tools/replay/check_command.hpp"

#include "pipeline/replay/recording_check.hpp"

namespace fiducap {
namespace {

void print_stream(const Terminal& terminal, const RecordedStream& stream) {
  terminal.out << "  " << stream.file << ": " << stream.stamps << " lines";
  if (stream.stamps > 0) {
    terminal.out << ", " << fixed(to_seconds(stream.last - stream.first), 1) << " s";
    if (stream.step > Duration{0})
      terminal.out << ", one in " << fixed(1e3 * to_seconds(stream.step), 1) << " ms";
  }
  if (stream.left_out > 0)
    terminal.out << "; " << stream.left_out
                 << " left out: their stamps are out of order or far from the others";
  terminal.out << "\n";
}

int check(const std::string& folder, const Terminal& terminal) {
  const auto info = read_recording_info(folder);
  if (!info) return report(terminal, info.error());
  const auto checked = check_recording(*info);
  if (!checked) return report(terminal, checked.error());
  terminal.out << folder << "\n";
  for (const RecordedStream& stream : checked->streams) print_stream(terminal, stream);
  for (const RecordingFinding& finding : checked->findings)
    terminal.out << (finding.unusable ? "  unusable: " : "  warning: ") << finding.text << "\n";
  if (checked->findings.empty()) terminal.out << "  nothing to object to\n";
  return checked->is_usable() ? kExitOk : kExitFailed;
}

}  // namespace

int run_check(const CheckArguments& arguments, const Terminal& terminal) {
  int exit_code = kExitOk;
  for (const std::string& folder : arguments.recordings)
    if (check(folder, terminal) != kExitOk) exit_code = kExitFailed;
  return exit_code;
}

}  // namespace fiducap
