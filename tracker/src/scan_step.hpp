#pragma once

#include <optional>

#include "band_solver.hpp"
#include "stretch_sums.hpp"
#include "tubetrack/tracker/fit.hpp"

namespace tubetrack {

/// What Gauss-Newton says of a stretch of a scan's tube.
struct ScanStepQuality {
  double radius_sigma_m = 0.0;
  BandMatrix covariance;  ///< as FitQuality's; empty where it is not wanted
};

/// `fit_tube` for a scan, which has no earlier frames to keep anything for: the equations are held as the band that
/// they are. Of the options, radius, its range, steps and covariance count. Observations are sorted by the model's
/// stretches.
std::optional<ScanStepQuality> fit_scan_stretch(TubeModel& model, const SortedObservations& observations,
                                                const FitOptions& options);

}  // namespace tubetrack
