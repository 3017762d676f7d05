#include "observe.hpp"

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

/// Origins of the spans, side by side in floats.
void set_origins(const Spline& spline, Sighting& sighting) {
  const std::size_t spans = spline.control_m.size() - 3;
  for (RecycledVector<float>& axis : sighting.origin_m) axis.resize(spans);
  for (std::size_t k = 0; k < spans; ++k) {
    const Eigen::Vector3f origin_m = point_at(spline, static_cast<double>(k)).cast<float>();
    for (std::size_t axis = 0; axis < 3; ++axis) sighting.origin_m[axis][k] = origin_m[static_cast<int>(axis)];
  }
}

/// Where one more goes.
void put(const ChosenPixels& chosen, std::size_t i, std::size_t at, SortedObservations& sorted) {
  ObservationBlock& block = sorted.blocks[at / kPartials];
  const std::size_t lane = at % kPartials;
  block.x[lane] = chosen.x[i];
  block.y[lane] = chosen.y[i];
  block.z[lane] = chosen.z[i];
  block.direction_x[lane] = chosen.direction_x[i];
  block.direction_y[lane] = chosen.direction_y[i];
  block.direction_z[lane] = 1.0F;
  block.weight[lane] = chosen.weight[i];
  block.s[lane] = chosen.s[i];
}

}  // namespace

void observe(const HeightMap& map, const NoiseModel& noise, const Spline& spline, const PredictedPixels& pixels,
             const Gates& gates, const Extent& extent, Sighting& sighting) {
  const std::size_t stretches = (spline.control_m.size() - 3) * kStretchesPerSpan;
  set_origins(spline, sighting);
  const PixelChoice choice{map.depth_m.data(),
                           map.rays.data()->data(),
                           levels_of_readings(map, noise),
                           gates.near_m,
                           gates.far_m,
                           gates.sigmas,
                           least_margin_px(noise),
                           not_below(extent.t_begin),
                           not_above(extent.t_end),
                           static_cast<int>(stretches),
                           kStretchesPerSpan,
                           sighting.origin_m[0].data(),
                           sighting.origin_m[1].data(),
                           sighting.origin_m[2].data()};
  ChosenPixels& chosen = sighting.chosen;
  choose_pixels(choice, pixels, chosen);
  sighting.near_next.assign(stretches, 0);
  sighting.far_next.assign(stretches, 0);
  const auto next = [&](std::uint32_t place) -> std::size_t& {
    return ((place & 1U) != 0 ? sighting.near_next : sighting.far_next)[place / 2];
  };
  for (std::size_t i = 0; i < chosen.count; ++i) ++next(chosen.place[i]);
  make_room(spline, sighting.near_next, sighting.near);
  make_room(spline, sighting.far_next, sighting.far);
  for (std::size_t i = 0; i < chosen.count; ++i) {
    const std::uint32_t place = chosen.place[i];
    put(chosen, i, next(place)++, (place & 1U) != 0 ? sighting.near : sighting.far);
  }
}

RecycledVector<Observation> select_observations(const HeightMap& map, const NoiseModel& noise,
                                                const PredictedPixels& predicted, double gate_m,
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
