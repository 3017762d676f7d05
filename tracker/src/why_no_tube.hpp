#pragma once

#include <optional>
#include <string>

#include "tubetrack/tracker/grow.hpp"

namespace tubetrack {

/// What the tube's own surface says against it: the part of `why_no_tube` that does not need a look beside it.
std::optional<Reason> why_no_surface(const Evidence& evidence, double radius_m, const TrackerConfig& config);

/// What neither growing on nor a closer look repairs: the bounds of `why_no_surface`, with a margin.
bool hopeless(const Evidence& evidence, double radius_m, const TrackerConfig& config);

}  // namespace tubetrack
