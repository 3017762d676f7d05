#include "observe.hpp"

#include <algorithm>
#include <cmath>

#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

/// How far inside the silhouette a pixel must be, so that what jitters across it neither comes in nor is missing.
float least_margin_px(const NoiseModel& noise) {
  return 3.0F * static_cast<float>(noise.lateral_px);
}

/// Which pixels, and how many in each stretch.
std::span<const Sighting::Chosen> choose(const HeightMap& map, const NoiseModel& noise,
                                         std::span<const PredictedPixel> pixels, const Gates& gates,
                                         const Extent& extent, Sighting& sighting) {
  const std::size_t stretches = sighting.near_next.size();
  if (sighting.chosen.size() < pixels.size()) sighting.chosen.resize(pixels.size());
  Sighting::Chosen* chosen = sighting.chosen.data();
  const float margin_px = least_margin_px(noise);
  const DisparityLevels levels = levels_of_readings(map, noise);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const PredictedPixel& pixel = pixels[i];
    const float measured_m = map.depth_m[pixel.cell];
    if (measured_m <= 0.0F || pixel.cos_incidence < kCos75 || pixel.margin_px < margin_px) continue;
    if (pixel.t < extent.t_begin || pixel.t > extent.t_end) continue;
    const double depth_m = unbiased_m(levels, pixel, measured_m);
    const double off_m = std::abs(depth_m - pixel.depth_m);
    const double noise_m = gates.sigmas * pixel.sigma_m;
    if (off_m > gates.far_m + noise_m) continue;
    const std::size_t k = stretch_of(pixel.t, stretches);
    const bool is_near = off_m <= gates.near_m + noise_m;
    ++(is_near ? sighting.near_next : sighting.far_next)[k];
    *chosen++ = {static_cast<float>(depth_m), static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(k), is_near};
  }
  return {sighting.chosen.data(), chosen};
}

}  // namespace

void observe(const HeightMap& map, const NoiseModel& noise, const Spline& spline,
             std::span<const PredictedPixel> pixels, const Gates& gates, const Extent& extent, Sighting& sighting) {
  const std::size_t stretches = (spline.control_m.size() - 3) * kStretchesPerSpan;
  const auto spans = static_cast<float>(spline.spans());
  sighting.near_next.assign(stretches, 0);
  sighting.far_next.assign(stretches, 0);
  const std::span<const Sighting::Chosen> chosen = choose(map, noise, pixels, gates, extent, sighting);
  make_room(spline, sighting.near_next, sighting.near);
  make_room(spline, sighting.far_next, sighting.far);
  for (const Sighting::Chosen& one : chosen) {
    const PredictedPixel& pixel = pixels[one.pixel];
    const Eigen::Vector3f direction(map.rays[pixel.cell].x(), map.rays[pixel.cell].y(), 1.0F);
    const std::size_t span = one.stretch / kStretchesPerSpan;
    SortedObservations& side = one.is_near ? sighting.near : sighting.far;
    const std::size_t at = (one.is_near ? sighting.near_next : sighting.far_next)[one.stretch]++;
    // In floats: a hundred-millionth of the depth off, by chance.
    const Eigen::Vector3f from_origin = one.depth_m * direction - side.origin_m[span].cast<float>();
    const float s = std::clamp(pixel.t, 0.0F, spans) - static_cast<float>(span);
    put(from_origin, direction, 1.0F / (pixel.sigma_m * pixel.sigma_m), s, at, side);
  }
}

RecycledVector<Observation> select_observations(const HeightMap& map, const NoiseModel& noise,
                                                const RecycledVector<PredictedPixel>& predicted, double gate_m,
                                                double gate_sigmas, const Extent& extent) {
  const float margin_px = least_margin_px(noise);
  const DisparityLevels levels = levels_of_readings(map, noise);
  RecycledVector<Observation> observations;
  observations.reserve(predicted.size());
  for (const PredictedPixel& pixel : predicted) {
    const float measured = map.depth_m[pixel.cell];
    if (measured <= 0.0F || pixel.cos_incidence < kCos75 || pixel.margin_px < margin_px) continue;
    if (pixel.t < extent.t_begin || pixel.t > extent.t_end) continue;
    const double depth_m = unbiased_m(levels, pixel, measured);
    if (std::abs(depth_m - pixel.depth_m) > gate_m + gate_sigmas * pixel.sigma_m) continue;
    const Eigen::Vector3d ray(map.rays[pixel.cell].x(), map.rays[pixel.cell].y(), 1.0);
    const double norm = ray.norm();
    observations.push_back({depth_m * ray, ray / norm, pixel.sigma_m * norm, pixel.t});
  }
  return observations;
}

}  // namespace tubetrack
