#include "observe.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "choose_pixels.hpp"
#include "stretch_sums.hpp"
#include "tubetrack/tracker/recycled.hpp"

namespace tubetrack {

namespace {

/// How far inside the silhouette a pixel must be, so that what jitters across it neither comes in nor is missing.
float least_margin_px(const NoiseModel& noise) {
  return 3.0F * static_cast<float>(noise.lateral_px);
}

/// Places are doubles, those of pixels floats: the same pixels are within these.
float not_below(double value) {
  const auto rounded = static_cast<float>(value);
  return rounded < value ? std::nextafter(rounded, std::numeric_limits<float>::infinity()) : rounded;
}
float not_above(double value) {
  return -not_below(-value);
}

}  // namespace

void observe(const HeightMap& map, const NoiseModel& noise, const Spline& spline, const PredictedPixels& pixels,
             const Gates& gates, const Extent& extent, Sighting& sighting) {
  const std::size_t stretches = (spline.control_m.size() - 3) * kStretchesPerSpan;
  const PixelChoice choice{map.depth_m.data(),
                           map.rays.data()->data(),
                           map.rays.size(),
                           levels_of_readings(map, noise),
                           static_cast<float>(gates.near_m),
                           static_cast<float>(gates.far_m),
                           static_cast<float>(gates.sigmas),
                           least_margin_px(noise),
                           not_below(extent.t_begin),
                           not_above(extent.t_end),
                           static_cast<int>(stretches)};
  ChosenPixels& chosen = sighting.chosen;
  choose_pixels(choice, pixels, chosen);
  sighting.near_next.assign(stretches, 0);
  sighting.far_next.assign(stretches, 0);
  std::size_t* const next[] = {sighting.far_next.data(), sighting.near_next.data()};  // by the lowest bit of a place
  for (std::size_t i = 0; i < chosen.count; ++i) ++next[chosen.place[i] & 1U][chosen.place[i] / 2];
  make_room(spline, sighting.near_next, sighting.near);
  make_room(spline, sighting.far_next, sighting.far);
  SortedObservations* const sides[] = {&sighting.far, &sighting.near};
  sighting.origin_m.resize(sighting.near.origin_m.size());
  std::transform(sighting.near.origin_m.begin(), sighting.near.origin_m.end(), sighting.origin_m.begin(),
                 [](const Eigen::Vector3d& origin_m) {
                   const Eigen::Vector3f numbers = origin_m.cast<float>();
                   return ObservedPoint{numbers.x(), numbers.y(), numbers.z(), 0.0F};
                 });
  for (std::size_t i = 0; i < chosen.count; ++i) {
    const std::uint32_t place = chosen.place[i];
    SortedObservations& side = *sides[place & 1U];
    const std::size_t at = next[place & 1U][place / 2]++;
    // In floats: a hundred-millionth of the depth off, by chance. All four numbers at once.
    const auto numbers = [](const ObservedPoint& point) { return Eigen::Map<const Eigen::Vector4f>(&point.x); };
    Eigen::Map<Eigen::Vector4f>(&side.points[at].x) =
        numbers(chosen.points[i]) - numbers(sighting.origin_m[place / (2 * kStretchesPerSpan)]);
    side.rays[at] = chosen.rays[i];
  }
}

RecycledVector<Observation> select_observations(const HeightMap& map, const NoiseModel& noise,
                                                const PredictedPixels& predicted, double gate_m, double gate_sigmas,
                                                const Extent& extent) {
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
