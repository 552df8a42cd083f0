#include "estimation/robocentric/robocentric_filter.hpp"

#include "estimation/conversation/admission_impl.hpp"
#include "estimation/conversation/body_follower_impl.hpp"
#include "estimation/conversation/filter_conversation_impl.hpp"
#include "estimation/conversation/relocalisation_impl.hpp"

namespace fiducap {
template class FilterConversation<robocentric::RobocentricCoordinates>;
}
