#pragma once

#include "tubetrack/tracker/follow.hpp"
#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/spline.hpp"
#include "tubetrack/tracker/stations.hpp"

namespace tubetrack {

/// Lets the line go on from [t_begin, t_end] as it runs there, with the mean bend of its last three control points: all
/// beyond is forgotten. A side with fewer than five control points left to go on from stays as it is.
void continue_from(Spline& spline, double t_begin, double t_end);

/// Which ends are turned toward the camera: there it sees the end's own face, which, fitted as the tube's surface,
/// bends the line.
struct TurnedEnds {
  bool at_begin = false;
  bool at_end = false;
};
TurnedEnds turned_to_camera(const Spline& spline, const Extent& extent);

/// How far short of the ends of an extent a line is fitted, in spans: an end that is turned toward the camera may show
/// its own face. A short piece gives up a tenth there, and what is seen only little beyond a gap half of that, or the
/// line would run on across the gap with nothing to hold it. All other ends are fitted to the last reading: what is
/// left out has to be guessed, and a guessed end is several times as far off as a seen one.
EndTrim trim_of(const Spline& spline, const RecycledVector<Station>& stations, const Extent& extent);

/// Is nine tenths of an extent seen, and from either end four spans and more without a gap?
bool is_well_seen(const RecycledVector<Station>& stations, const Extent& extent);

/// Does the image leave it open at an end of a line whether a tube goes on behind something nearer? Mostly the camera
/// looks past the end, which two radii beyond it show.
bool may_go_on(const HeightMap& map, const NoiseModel& noise, const TubeModel& model, int stride);

}  // namespace tubetrack
