#pragma once

#include "tubetrack/tracker/spline.hpp"

namespace tubetrack {

/// Lets the line go on from [t_begin, t_end] as it runs there, with the mean bend of its last three control points: all
/// beyond is forgotten. A side with fewer than five control points left to go on from stays as it is.
void continue_from(Spline& spline, double t_begin, double t_end);

}  // namespace tubetrack
