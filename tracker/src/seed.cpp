#include "tubetrack/tracker/seed.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "fit_steps.hpp"
#include "observe.hpp"
#include "shape_sums.hpp"
#include "tubetrack/tracker/fit.hpp"
#include "tubetrack/tracker/stations.hpp"

namespace tubetrack {

namespace {

/// So that a seed has some thousands of pixels at most: enough to tell whether it is worth growing.
int seed_stride(const HeightMap& map, const Seed& seed, double radius_m) {
  const double side_px = 2.0 * radius_m * map.intrinsics.fx_px / std::max(seed.center_m.z(), 0.05);
  return std::max(1, static_cast<int>(side_px / 45.0));
}

/// Is what is seen there nearly as flat as a plane? Then it is no tube of anything like that radius.
bool is_flat(const HeightMap& map, const TubeModel& model, const PredictedPixels& pixels) {
  ShapeSums shape;
  for (const PredictedPixel& pixel : pixels) {
    const float measured = map.depth_m[pixel.cell];
    if (measured > 0.0F && pixel.cos_incidence >= kCos75) add_to_shape(model, pixel, measured - pixel.depth_m, shape);
  }
  constexpr double kFlat = 0.75;  // of 1; a tube of four times the radius
  return shape.slope() > kFlat && shape.slope() - 2.0 * shape.slope_sigma() > kFlat - 0.2;
}

/// The least that a tube's seed has of these, and the most: of 383 on real and synthetic frames the extremes are
/// behind.
constexpr double kLeastUsed = 0.35;      // of the predicted pixels, once it has been placed: 0.45
constexpr double kLeastSupport = 0.55;   // 0.71
constexpr double kLeastArc_rad = 1.15;   // 1.4
constexpr double kLeastThickness = 0.5;  // of the radius that was voted for: 0.67
constexpr double kMostNoise = 3.0;       // times what is expected: 2.28

/// Edges and corners are fitted thinner and thinner, as fast as steps allow. A tube is no such place: where its first
/// fit is too thin, the next is not.
bool shrinks_away(double before_m, double then_m, double now_m) {
  constexpr double kShrinks = 0.8;
  return then_m < kShrinks * before_m && now_m < kShrinks * then_m;
}

/// Does what a short piece shows rule out that more of it is a tube?
bool is_refuted(const Evidence& e, const TubeModel& model, const Seed& seed, const TrackerConfig& config) {
  const bool in_range = model.radius_m > 0.85 * config.radius_min_m && model.radius_m < 1.15 * config.radius_max_m;
  const bool thinner = !config.radius_m && model.radius_m < kLeastThickness * seed.radius_m;
  return !in_range || thinner || e.support < kLeastSupport || std::abs(e.flatness) > 0.6 || e.arc_rad < kLeastArc_rad ||
         e.noise_ratio > kMostNoise;
}

}  // namespace

std::optional<FoundTube> fit_seed(const HeightMap& map, const TrackerConfig& config, const Seed& seed) {
  FoundTube found;
  TubeModel& model = found.model;
  model.radius_m = config.radius_m.value_or(seed.radius_m);
  const Eigen::Vector3d half = model.radius_m * seed.axis;
  model.spline =
      spline_along({seed.center_m - half, seed.center_m, seed.center_m + half}, kKnotSpacingRadii * model.radius_m);
  FitOptions options;
  options.suppleness = 0.02;
  options.radius_min_m = 0.5 * config.radius_min_m;
  options.radius_max_m = 1.5 * config.radius_max_m;
  const int stride = seed_stride(map, seed, model.radius_m);
  thread_local Sighting sighting;  // for their buffers
  thread_local PredictedPixels pixels;
  constexpr std::array<double, 4> kGatesRadii{0.5, 0.3, 0.2, 0.15};
  double before_m = model.radius_m;
  for (const double gate_radii : kGatesRadii) {
    const bool is_first = gate_radii == kGatesRadii[0];
    options.radius_m = is_first ? model.radius_m : config.radius_m;
    predict_pixels(map, config.noise, model, stride, pixels);
    if (gate_radii == kGatesRadii[1] && !config.radius_m && is_flat(map, model, pixels)) return std::nullopt;
    const double gate_m = gate_radii * model.radius_m;
    observe(map, config.noise, model.spline, pixels, {gate_m, gate_m, 3.0}, kWholeTube, sighting);
    if (!is_first && static_cast<double>(sighting.near.count) < kLeastUsed * static_cast<double>(pixels.count))
      return std::nullopt;
    options.want_covariance = false;
    const double then_m = model.radius_m;
    if (!fit_tube(model, sighting.near, options) || shrinks_away(before_m, then_m, model.radius_m)) return std::nullopt;
    before_m = then_m;
  }
  found.extent = {0.0, model.spline.spans()};
  predict_pixels(map, config.noise, model, stride, pixels);
  const auto stations = stations_of(map, model, pixels, station_length_m(map, model));
  found.evidence = surface_evidence(map, config.noise, model, pixels, stations, found.extent);
  if (is_refuted(found.evidence, model, seed, config)) return std::nullopt;
  return found;
}

}  // namespace tubetrack
