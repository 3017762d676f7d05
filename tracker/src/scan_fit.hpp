#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "band_solver.hpp"
#include "scan_grid.hpp"
#include "tubetrack/tracker/fit.hpp"

namespace tubetrack {

/// The centreline of a scan's tube while it is fitted. A closed one has no ends: its spline goes once around and
/// `overlap` spans on at either end, where control points are there twice, `period` apart; (0, 0) for an open one.
struct ScanLine {
  TubeModel model;
  int overlap = 0;
  int period = 0;

  bool closed() const { return period > 0; }
};

/// Along a polyline of at least 2 points; a closed one's last point is next to its first.
ScanLine scan_line_along(const std::vector<Eigen::Vector3d>& polyline_m, double radius_m, bool closed);

/// A surfel near a tube and where on it.
struct SurfacePoint {
  double t = 0.0;  ///< its foot on the centreline
  std::uint32_t surfel = 0;
  float lift_m = 0.0F;                                ///< the surface lies so far outward of the surfel, a mean
  float distance_m = 0.0F;                            ///< of the surface from the centreline
  Eigen::Vector3f inward = Eigen::Vector3f::UnitX();  ///< unit, from the point to its foot
};

/// The surfels that belong to a tube (paper, section 2.3): those whose nearest node has them within half a step along
/// the axis, and that lie between half of the radius and 1.5 radii from it, their normals within 60° of pointing at the
/// axis, and within 24° of the section, which leaves out most of a rounded end. In the order of the surfels; where a
/// closed line overlaps itself, once for each of its places. `taken`: one flag a surfel, those set are left out; may be
/// empty. `every`: only those whose number it divides.
std::vector<SurfacePoint> points_near(const SurfelGrid& grid, std::span<const char> taken, const ScanLine& line,
                                      std::size_t every = 1);

/// The same points on a line that has moved a little since: each is placed once more, from where it was, which takes
/// far less than points_near. What comes into the line's reach by the move is not among them.
void place_again(const SurfelGrid& grid, const ScanLine& line, std::vector<SurfacePoint>& points);

/// A stretch of the fit with its covariance, FitQuality's, of control points `first` and on.
struct FitWindow {
  std::size_t first = 0;
  double t_begin = 0.0;  ///< the stretch that it speaks for, in spans of the whole line
  double t_end = 0.0;
  Spline spline;
  BandMatrix covariance;
};

struct ScanFit {
  double scale_m = 0.0;  ///< robust σ of the surfels' distances from the tube's surface
  double radius_sigma_m = 0.0;
  std::vector<FitWindow> windows;  ///< in order, without gaps
};

struct ScanFitOptions {
  std::optional<double> radius_m;  ///< known: held
  double radius_min_m = 0.0;       ///< a fit that leaves this range fails
  double radius_max_m = 0.0;
  double least_scale_m = 0.0;  ///< what the surfels err by at least
  double t_begin = 0.0;        ///< surfels between these places of the line are fitted to
  double t_end = 1e9;
  double first_scale_radii = 0.0;  ///< the first rounds take surfels to err by so much, halved each time
  int rounds = 2;                  ///< of choosing surfels and Gauss-Newton
  int steps = 2;                   ///< of Gauss-Newton in each
  std::size_t every = 1;           ///< to every so many of the surfels
  bool one_radius = true;          ///< of all windows of a long line; else each has its own, which is quicker
  bool want_covariance = false;
};

/// Moves the line and its radius to the surfels around (equations 1 and 2 of section 2.3: distances to a circle, here
/// of all nodes together and weighted by area): residuals along the tube's own normal, those that stand out count less
/// (Geman-McClure). Long lines are fitted in windows, so that the time grows with the length alone. Nothing where too
/// few surfels are near, or the radius leaves its range. `points` gets the surfels of the line that came out, as
/// points_near or place_again find them.
std::optional<ScanFit> fit_scan_line(const SurfelGrid& grid, std::span<const char> taken, ScanLine& line,
                                     const ScanFitOptions& options, std::vector<SurfacePoint>& points);

}  // namespace tubetrack
