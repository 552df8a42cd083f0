#pragma once

#include <array>
#include <string_view>

#include "base/words.hpp"
#include "daemon/config/config_file.hpp"
#include "streaming/conventions/validity.hpp"
#include "streaming/operator_desk.hpp"

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
inline constexpr std::array<Word<UpAxis>, 3> kUpAxis{
    {{"z", UpAxis::kZ}, {"y", UpAxis::kY}, {"down", UpAxis::kDown}}};
inline constexpr std::array<Word<WhenInvalid>, 3> kWhenInvalid{
    {{"flag", WhenInvalid::kFlag}, {"stop", WhenInvalid::kStop}, {"hold", WhenInvalid::kHold}}};
inline constexpr std::array<Word<RemoteControl>, 3> kRemoteControl{
    {{"off", RemoteControl::kOff},
     {"loopback", RemoteControl::kLoopback},
     {"all", RemoteControl::kAll}}};
inline constexpr std::array<Word<dds::Px4Profile>, 3> kPx4Profile{{{"off", dds::Px4Profile::kOff},
                                                                   {"ned", dds::Px4Profile::kNed},
                                                                   {"frd", dds::Px4Profile::kFrd}}};
inline constexpr std::array<Word<AutopilotWorld>, 2> kAutopilotWorld{
    {{"ned", AutopilotWorld::kNed}, {"frd", AutopilotWorld::kFrd}}};
inline constexpr std::array<Word<mavlink::PoseMessage>, 3> kPoseMessage{
    {{"odometry", mavlink::PoseMessage::kOdometry},
     {"vision-position", mavlink::PoseMessage::kVisionPosition},
     {"both", mavlink::PoseMessage::kBoth}}};
inline constexpr std::array<Word<AxesScope>, 2> kAxesScope{
    {{"world", AxesScope::kWorld}, {"world-and-body", AxesScope::kWorldAndBody}}};

}  // namespace fiducap::words
