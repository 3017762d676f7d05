#include "scan_result.hpp"

#include <algorithm>
#include <cmath>

#include "scan_chain.hpp"
#include "tube_result.hpp"

namespace tubetrack {

namespace {

const FitWindow& window_at(const ScanFit& fit, double t) {
  const auto after = std::lower_bound(fit.windows.begin(), fit.windows.end(), t,
                                      [](const FitWindow& window, double at) { return window.t_end < at; });
  return after == fit.windows.end() ? fit.windows.back() : *after;
}

/// Of the centreline's place at t, from that of the window's control points.
Eigen::Matrix3d covariance_at(const FitWindow& window, double t) {
  const SplineBasis basis = basis_at(window.spline, t);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j)
      covariance += basis.value[i] * basis.value[j] * window.covariance.block(basis.first + i, basis.first + j);
  }
  return covariance;
}

/// Radius at t: of the seen stations within two radii, weighted by what agrees there.
double radius_near(const ScanEvidence& evidence, double t, double otherwise_m) {
  constexpr double kNearSpans = 2.0 / kKnotSpacingRadii;
  double sum = 0.0, weights = 0.0;
  const auto before = [](const ScanStation& station, double at) { return station.t < at; };
  const auto& stations = evidence.stations;
  for (auto at = std::lower_bound(stations.begin(), stations.end(), t - kNearSpans, before);
       at != stations.end() && at->t <= t + kNearSpans; ++at) {
    const ScanStation& station = *at;
    if (!station.seen) continue;
    sum += station.agree * station.radius_m;
    weights += station.agree;
  }
  return weights > 0.0 ? sum / weights : otherwise_m;
}

/// Fills in node_radius_m where the radius varies along the tube: by more than a tenth, and seen from all around, or a
/// bend of a half-seen tube would be taken for it.
void add_node_radii(const ScanTube& found, Tube& tube) {
  constexpr double kVaries = 0.1;
  if (found.evidence.arc_rad < kAllAround_rad) return;
  std::vector<double> radii_m;
  const double begin = found.evidence.t_begin, end = found.evidence.t_end;
  const auto spans = static_cast<double>(tube.centerline_m.size() - 1);
  for (std::size_t i = 0; i < tube.centerline_m.size(); ++i) {
    const double t = begin + (end - begin) * static_cast<double>(i) / spans;
    radii_m.push_back(radius_near(found.evidence, t, tube.radius_m));
  }
  const auto [least, most] = std::minmax_element(radii_m.begin(), radii_m.end());
  if (*most - *least > kVaries * tube.radius_m) tube.node_radius_m = std::move(radii_m);
}

/// The parts of the line; where they are all straight or toric, fitted to the surface.
void add_scan_parts(const ScanTube& found, const SurfelGrid& grid, const ScanTubesConfig& config, Tube& tube) {
  CenterlineParts parts = cut_into_parts(fitted_centerline(tube));
  if (parts.fitted) {
    if (auto finer = fit_chain_to_surface(parts.fitted->chain, found, grid, config)) {
      parts.segments = segments_of(finer->chain);
      parts.fitted = std::move(finer);
    }
  }
  set_parts(parts, tube);
}

}  // namespace

Tube result_of(const ScanTube& found, const SurfelGrid& grid, const ScanTubesConfig& config) {
  Tube tube;
  const Spline& spline = found.line.model.spline;
  const ScanEvidence& evidence = found.evidence;
  tube.radius_m = found.line.model.radius_m;
  tube.radius_sigma_m = found.fit.radius_sigma_m;
  tube.confidence = std::min(1.0, evidence.support);
  tube.closed = found.line.closed() && evidence.t_end - evidence.t_begin >= found.line.period;
  constexpr double kNodeRadii = 0.5;
  const int spans = std::max(2, static_cast<int>(std::ceil(evidence.length_m / (kNodeRadii * tube.radius_m))));
  std::size_t station = 0;
  for (int i = 0; i <= spans; ++i) {
    const double t = evidence.t_begin + (evidence.t_end - evidence.t_begin) * i / spans;
    tube.centerline_m.push_back(point_at(spline, t));
    while (station + 1 < evidence.stations.size() &&
           std::abs(evidence.stations[station + 1].t - t) <= std::abs(evidence.stations[station].t - t))
      ++station;
    tube.node_visible.push_back(evidence.stations[station].seen);
    const FitWindow& window = window_at(found.fit, t);
    const double in_window = t - static_cast<double>(window.first);
    add_place_uncertainty(window.spline, covariance_at(window, in_window), in_window, tube);
  }
  if (tube.closed) tube.centerline_m.back() = tube.centerline_m.front();
  add_node_radii(found, tube);
  tube.length_m = polyline_length_m(tube.centerline_m);
  add_scan_parts(found, grid, config, tube);
  return tube;
}

}  // namespace tubetrack
