#pragma once

#include <memory>
#include <string>
#include <vector>

#include "capture/import/import_source.hpp"
#include "capture/import/parts_source.hpp"

namespace fiducap {

/// A folder in the EuRoC/ASL layout as it comes, also without calibration, without lists of images,
/// or with images of 16 bits (TUM-VI). Truth and tags are taken over.
[[nodiscard]] Expected<std::unique_ptr<ImportSource>> open_asl_import(const std::string& path,
                                                                      const ImportOptions& options);

/// Pictures of a folder whose names are numbers, by these.
/// @param unit_ns  of the numbers
[[nodiscard]] std::vector<ListedImage> pictures_by_number(const std::string& folder,
                                                          std::int64_t unit_ns);

}  // namespace fiducap
