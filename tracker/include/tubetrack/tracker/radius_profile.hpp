#pragma once

#include <Eigen/Core>

#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/spline.hpp"

namespace tubetrack {

/// By how much a tube is thicker than its one radius, along its centreline (`varying_radius`): a uniform cubic B-spline
/// with wide knots. They are counted in spans from where the centreline was begun (Spline::first_span), so that the
/// profile stays in its place as the line grows and shrinks. No values: one radius everywhere.
struct RadiusProfile {
  int first = 0;  ///< number of the first control value; value k has its knot at kProfileSpans (k + 1)
  RecycledVector<double> offset_m;  ///< control values: 4 or more, or none
};

/// Knots are this many spans of the centreline apart: 2.5 radii.
inline constexpr double kProfileSpans = 2.0;

/// The four control values that shape the offset at t (in spans of the centreline), and their weights. Beyond what the
/// profile covers: those of its nearest end. The profile must not be empty.
SplineBasis profile_basis_at(const RadiusProfile& profile, const Spline& spline, double t);

/// Metres; 0 where there is no profile.
double radius_offset_m(const RadiusProfile& profile, const Spline& spline, double t);

/// Adds control values at either end until the profile covers the spline, going on as it ends.
void cover(RadiusProfile& profile, const Spline& spline);

/// Largest less smallest control value; 0 where there is no profile.
double spread_m(const RadiusProfile& profile);

}  // namespace tubetrack
