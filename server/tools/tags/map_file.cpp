#include "tools/tags/map_file.hpp"

#include <filesystem>

#include "mapping/formats/map_yaml.hpp"
#include "tools/whole_file.hpp"

namespace fiducap {

Expected<TagMap> read_map_file(const std::string& path, std::optional<double> edge_m) {
  const auto text = read_whole_file(path);
  if (!text) return tl::unexpected(text.error());
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".yaml" || extension == ".yml") return map_from_yaml(*text, path);
  if (extension == ".csv") return map_from_csv(*text, path);
  if (extension != ".json")
    return fail(ErrorCode::kUnsupported,
                "maps are read from .yaml, .csv and .json (WPILib), not '" + extension + "'", path);
  if (!edge_m)
    return fail(ErrorCode::kInvalid,
                "WPILib files do not say how large the tags are; add --tag-size METRES", path);
  return map_from_wpilib_json(*text, *edge_m, path);
}

Expected<void> write_map_file(const std::string& path, const TagMap& map) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".yaml" || extension == ".yml") return write_whole_file(path, map_to_yaml(map));
  if (extension == ".csv") return write_whole_file(path, map_to_csv(map));
  return fail(ErrorCode::kUnsupported, "maps are written as .yaml or .csv, not '" + extension + "'",
              path);
}

}  // namespace fiducap
