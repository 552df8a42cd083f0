#include "tools/replay/session_folder.hpp"

#include <filesystem>

#include "capture/recording/recording_layout.hpp"
#include "tools/tags/map_file.hpp"

namespace fiducap {

namespace fs = std::filesystem;

bool is_session(const std::string& folder) {
  const fs::path path(folder);
  return is_file(path / "config.yaml") && is_file(path / "map.yaml") && is_file(path / "turns.csv");
}

Expected<SessionFolder> read_session(const std::string& folder,
                                     const std::vector<std::string>& sets) {
  const fs::path path(folder);
  SessionFolder session;
  session.folder = folder;
  auto config = load_config((path / "config.yaml").string(), sets);
  if (!config)
    return fail(ErrorCode::kInvalid, config.error().front().text(),
                (path / "config.yaml").string());
  session.config = std::move(*config);
  auto map = read_map_file((path / "map.yaml").string());
  if (!map) return tl::unexpected(map.error());
  session.map = std::move(*map);
  auto turns = read_map_turns(path / "turns.csv");
  if (!turns) return tl::unexpected(turns.error());
  session.turns = std::move(*turns);
  if (is_file(path / "refinements.csv")) {
    auto refinements = read_refinement_turns(path / "refinements.csv");
    if (!refinements) return tl::unexpected(refinements.error());
    session.refinements = std::move(*refinements);
  }
  for (const BodyConfig& body : session.config.bodies)
    session.bodies.push_back((path / body.name).string());
  return session;
}

std::optional<std::string> session_of(const std::string& recording) {
  std::error_code ignored;
  const fs::path whole = fs::canonical(recording, ignored);
  const std::string parent = whole.parent_path().string();
  return is_session(parent) ? std::optional(parent) : std::nullopt;
}

}  // namespace fiducap
