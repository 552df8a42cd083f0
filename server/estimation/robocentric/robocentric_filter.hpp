#pragma once

#include "estimation/conversation/filter_conversation.hpp"
#include "estimation/robocentric/robocentric_coordinates.hpp"

namespace fiducap {

extern template class FilterConversation<robocentric::RobocentricCoordinates>;

namespace robocentric {
/// The filter of RCARS II-D. Without IMU the same equations run with a white noise acceleration and
/// angular acceleration; the body rate is then −bias_w.
using RobocentricFilter = FilterConversation<RobocentricCoordinates>;
}  // namespace robocentric

}  // namespace fiducap
