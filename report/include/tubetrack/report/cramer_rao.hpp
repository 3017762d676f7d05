#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "tubetrack/sensors/noise_model.hpp"

namespace tubetrack {

/// What one pixel sees of a tube, without noise; in the camera's frame.
struct SurfacePixel {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = -Eigen::Vector3d::UnitZ();  ///< unit, outward
  Eigen::Vector3d along = Eigen::Vector3d::UnitX();    ///< unit, of the centreline below the point
  double from_start_m = 0.0;                           ///< arc length of the centreline there
};

/// The bound for one piece of centreline.
struct PieceBound {
  double from_m = 0.0;
  double to_m = 0.0;
  double sigma_m = 0.0;  ///< the larger axis across the tube; infinite where too little is seen
  double rms_m = 0.0;    ///< both axes together: the least RMS distance from the true centreline
};

struct TubeBound {
  std::vector<PieceBound> pieces;  ///< all of one length, from the first pixel on
  double radius_sigma_m = 0.0;
};

/// The Cramér-Rao bound of one frame: no unbiased estimate of a tube has a smaller σ. Known is what shape each piece
/// of `piece_m` has; unknown are where it lies (two numbers a piece) and the radius (one number for the tube). Each
/// pixel seen at less than 75° gives one reading of depth with the σ that the noise model has at its true incidence.
TubeBound cramer_rao_bound(std::span<const SurfacePixel> pixels, double piece_m, const NoiseModel& noise,
                           double focal_px);

}  // namespace tubetrack
