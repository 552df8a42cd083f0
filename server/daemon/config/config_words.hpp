#pragma once

#include <array>
#include <string_view>

#include "daemon/config/config_file.hpp"

/// The words a configuration uses for each enum.
namespace fiducap::words {

inline constexpr std::array<Word<log::Level>, 4> kLogLevel{{{"debug", log::Level::kDebug},
                                                            {"info", log::Level::kInfo},
                                                            {"warning", log::Level::kWarning},
                                                            {"error", log::Level::kError}}};
inline constexpr std::array<Word<MapMode>, 2> kMapMode{
    {{"mapping", MapMode::kMapping}, {"frozen", MapMode::kFrozen}}};
inline constexpr std::array<Word<Distortion>, 3> kDistortion{
    {{"none", Distortion::kNone},
     {"radial-tangential", Distortion::kRadialTangential},
     {"equidistant", Distortion::kEquidistant}}};
inline constexpr std::array<Word<SourceType>, 4> kSourceType{{{"simulator", SourceType::kSimulator},
                                                              {"recording", SourceType::kRecording},
                                                              {"camera", SourceType::kCamera},
                                                              {"ros", SourceType::kRos}}};

}  // namespace fiducap::words
